#include "snes/sneslatinimpl.h"

/*
   The equilibrium to which loads that grow from zero lead, where there may be others. Of cables alone the energy is convex in the
   displacements, and there is no other one. A link that bears compression may snap through; then a solve for the whole loads
   may end beyond. So the displacements are compared with those by the tangent stiffness at the start: along a path of stable
   equilibria with a limit point ahead, an increment of the loads moves the structure by at most twice as much. Where it has moved
   further, has found no equilibrium, or one whose tangent stiffness is not positive definite, the increment is halved. Increments that
   become small show a limit point, or a critical load.
*/

#define LATIN_PATH_FAR      2.0  /* times the displacements by the tangent stiffness: the limit of a fold, where force is a parabola of displacement */
#define LATIN_PATH_LEAST    1e-2 /* increments of the loads: smaller ones show a limit point */
#define LATIN_PATH_STAGES   60   /* most linear stages of one: at a limit point it takes any number */
#define LATIN_PATH_TANGENTS 4    /* times that Newton's method gets operators of the tangent stiffness in one increment */
#define LATIN_PATH_DRAWN    1e-2 /* forces without balance as drawn, relative to the loads: less moves the structure less than the loads do */
#define LATIN_PATH_NONE     1e-9 /* of the size of the structure: displacements that are none */

/* Can any link bear compression? Collective on structure */
static PetscErrorCode LatinPathStruts_Private(LatinStructure structure, PetscBool *struts)
{
  PetscMPIInt any = 0;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (structure->law[l] != LATIN_LAW_CABLE && structure->law[l] != LATIN_LAW_INEXTENSIBLE && !LatinStructureKeeps(structure, l)) any = 1;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, PetscObjectComm((PetscObject)structure)));
  *struts = (PetscBool)any;
  PetscFunctionReturn(0);
}

/*
   A solve from the displacements u. From an equilibrium, `near`, Newton's method takes a few steps, and bars in compression, which
   the local stage lets buckle one by one, do not disturb it; where it fails a smaller increment is better than the iteration.
   Collective on snes
*/
PetscErrorCode SNESLatinLargeFrom_Private(SNES snes, Vec u, PetscBool near)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscBool   done = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(SNESLatinLoad_Private(snes));
  PetscCall(VecCopy(u, snes->vec_sol));
  if (SNESLatinEstimates(data)) PetscCall(LatinEstimateStart_Private(data->latin, &data->estimate));
  data->guess          = PETSC_TRUE;
  data->has_state      = PETSC_FALSE;
  data->first_distance = -1.0;
  data->current        = -1;
  PetscCall(SNESLatinStart_Private(snes));
  if (near && SNESLatinEstimates(data) && data->newton.type != LATIN_NEWTON_NEVER) {
    data->next = LATIN_NEXT_LINE_SEARCH;
    PetscCall(SNESLatinLargeFinish_Private(snes, LATIN_PATH_TANGENTS, &done));
  } else {
    data->large.last = near ? data->latin->linear.applications + LATIN_PATH_STAGES : PETSC_MAX_INT;
    PetscCall(SNESLatinLargeIterate_Private(snes));
    if (LatinNextConverged(data->next)) PetscCall(SNESLatinResidual_Private(snes));
  }
  PetscFunctionReturn(0);
}

/* The right-hand side of snes for so much of the loads `whole`, and what it leaves without balance at u. Collective on snes */
static PetscErrorCode LatinPathLoad_Private(SNES snes, PetscReal part, Vec whole, Vec u, Vec more, Vec r)
{
  PetscFunctionBegin;
  PetscCall(VecWAXPY(more, -1.0, ((SNES_Latin *)snes->data)->large.frame->load, whole));
  PetscCall(VecAXPY(more, part - 1.0, whole));
  snes->vec_rhs = more;
  PetscCall(SNESComputeFunction(snes, u, r));
  PetscFunctionReturn(0);
}

/* Forces that differ from node to node: any mode has a part of them */
static PetscErrorCode LatinPathForces_Private(Vec r)
{
  PetscInt     first, last;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetOwnershipRange(r, &first, &last));
  PetscCall(VecGetArrayWrite(r, &a));
  for (PetscInt i = first; i < last; i++) a[i - first] = PetscSinReal((PetscReal)(i + 1));
  PetscCall(VecRestoreArrayWrite(r, &a));
  PetscFunctionReturn(0);
}

/* Is the tangent stiffness at u positive definite? A symmetric structure under symmetric loads does not show it by itself. Collective on snes */
static PetscErrorCode LatinPathStable_Private(SNES snes, Vec u, Vec r, PetscBool *stable)
{
  PetscReal moved;

  PetscFunctionBegin;
  PetscCall(LatinPathForces_Private(r));
  PetscCall(SNESLatinLargePredict_Private(snes, u, r, &moved));
  *stable = (PetscBool)(moved < PETSC_MAX_REAL);
  PetscFunctionReturn(0);
}

/* Is the drawn configuration u, without loads, a stable equilibrium, that a path may start from? Collective on snes */
static PetscErrorCode LatinPathStarts_Private(SNES snes, Vec whole, Vec u, Vec more, Vec r, PetscBool *starts)
{
  PetscReal left, loads;

  PetscFunctionBegin;
  PetscCall(LatinPathLoad_Private(snes, 0.0, whole, u, more, r));
  PetscCall(VecNorm(r, NORM_2, &left));
  PetscCall(VecNorm(whole, NORM_2, &loads));
  *starts = (PetscBool)(left <= LATIN_PATH_DRAWN * loads);
  if (*starts) PetscCall(LatinPathStable_Private(snes, u, r, starts));
  PetscFunctionReturn(0);
}

/* The path, with the loads `whole`, from the displacements u, the work vectors more and step. Collective on snes */
static PetscErrorCode LatinPathFollow_Private(SNES snes, Vec whole, Vec u, Vec more, Vec step)
{
  SNES_Latin *data      = (SNES_Latin *)snes->data;
  LatinLarge *large     = &data->large;
  PetscReal   increment = 1.0, moved, far;
  PetscBool   from      = PETSC_FALSE, holds;

  PetscFunctionBegin;
  PetscCall(VecZeroEntries(u));
  PetscCall(LatinPathStarts_Private(snes, whole, u, more, step, &from));
  while (large->reached < 1.0 && increment >= LATIN_PATH_LEAST && data->latin->linear.applications < snes->max_its) {
    const PetscReal part = PetscMin(1.0, large->reached + increment);

    PetscCall(LatinPathLoad_Private(snes, part, whole, u, more, step));
    PetscCall(SNESLatinLargePredict_Private(snes, u, step, &far));
    if (!from && large->reached == 0.0) far = PETSC_MAX_REAL; /* the prestress moves the structure by itself, who knows how far */
    PetscCall(SNESLatinLargeFrom_Private(snes, u, (PetscBool)(far < PETSC_MAX_REAL)));
    if (data->next == LATIN_NEXT_GIVEN) PetscFunctionReturn(0);
    PetscCall(VecWAXPY(step, -1.0, u, snes->vec_sol));
    PetscCall(VecNorm(step, NORM_2, &moved));
    holds = (PetscBool)((LatinNextConverged(data->next) || data->next == LATIN_NEXT_ROUNDING) && !(moved > PetscMax(LATIN_PATH_FAR * far, LATIN_PATH_NONE * large->size)));
    if (holds) PetscCall(LatinPathStable_Private(snes, snes->vec_sol, step, &holds));
    if (holds) {
      PetscCall(VecCopy(snes->vec_sol, u));
      large->reached = part;
      increment *= 2.0;
    } else increment *= 0.5;
    PetscCall(PetscInfo(snes, "%g of the loads: displacements change by %g, by the tangent stiffness by %g\n", (double)part, (double)moved, (double)far));
  }
  if (large->reached == 1.0) PetscFunctionReturn(0);
  PetscCall(VecCopy(u, snes->vec_sol));
  data->next = LATIN_NEXT_MAX_IT;
  if (data->latin->linear.applications >= snes->max_its) PetscFunctionReturn(0);
  PetscCall(PetscInfo(snes, "No equilibrium follows that of %g of the loads: it is a limit point, or unstable\n", (double)large->reached));
  data->next = LATIN_NEXT_DIVERGED;
  PetscCall(LatinPathForces_Private(step)); /* the mode that buckles is the softest one at the last equilibrium */
  PetscCall(SNESLatinLargeMode_Private(snes, u, step));
  PetscCall(LatinEquilibriumMoved_Private(large->frame->turns, step, &data->found));
  PetscFunctionReturn(0);
}

/* A solve, from the state z on. Collective on snes */
PetscErrorCode SNESLatinLargeRun_Private(SNES snes)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->turns;
  Vec            rhs       = snes->vec_rhs, work[4];
  PetscBool      struts;

  PetscFunctionBegin;
  PetscCall(LatinPathStruts_Private(structure, &struts));
  if (structure->midpoint && SNESLatinEstimates(data) && data->newton.type != LATIN_NEWTON_NEVER) {
    PetscBool done;

    PetscCall(SNESLatinLargeFinish_Private(snes, LATIN_PATH_TANGENTS, &done));
    if (!done) PetscCall(SNESLatinLargeIterate_Private(snes));
    data->large.reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
    PetscFunctionReturn(0);
  }
  if (!struts || structure->midpoint || data->guess || (data->warm && data->has_state) || data->stop == LATIN_STOP_REFERENCE || (snes->ops->converged && snes->ops->converged != SNESConvergedDefault)) {
    PetscCall(SNESLatinLargeIterate_Private(snes));
    data->large.reached = LatinNextConverged(data->next) ? 1.0 : 0.0;
    PetscFunctionReturn(0);
  }
  for (PetscInt i = 0; i < 4; i++) PetscCall(DMGetGlobalVector(structure->dm, &work[i]));
  PetscCall(VecCopy(structure->load, work[0]));
  if (rhs) PetscCall(VecAXPY(work[0], 1.0, rhs));
  PetscCall(LatinPathFollow_Private(snes, work[0], work[1], work[2], work[3]));
  snes->vec_rhs = rhs;
  for (PetscInt i = 0; i < 4; i++) PetscCall(DMRestoreGlobalVector(structure->dm, &work[i]));
  PetscCall(SNESLatinBalance_Private(snes));
  PetscFunctionReturn(0);
}
