#include "snes/largepath.h"

/*
   Start of the path of the loads, a stable equilibrium. The first of these that exists:

   1. The last solution of a warm start, or the initial guess, under the loads that it bears.
   2. Without loads: the drawing, or where its tensions move it.
   3. Without loads: down the energy from the drawing.
   4. Under all loads, a tenth or a hundredth of them: down the energy, as for a mechanism that the loads alone hold.
*/

#define LATIN_PATH_PART 0.1 /* factor on the loads from one try to the next, if no start is found under the larger ones */
/*
   largest residual, relative to the forces, of the solve that tests stability; more is left if a mechanism bears a part of the forces, which the norm of
   the linear solver may not see
*/
#define LATIN_PATH_RESIDUAL    0.1
#define LATIN_PATH_REFINEMENTS 3 /* solves of this test: the first and steps of iterative refinement */

/* Sets right-hand side and supports to this part of the path. Collective on snes */
PetscErrorCode LatinPathLoad_Private(SNES snes, const LatinPath *path, PetscReal part)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(VecWAXPY(path->more, -1.0, data->large.frame->load, path->first));
  PetscCall(VecAXPBYPCZ(path->more, part, -part, 1.0, path->whole, path->first));
  snes->vec_rhs = path->more;
  PetscCall(SNESLatinSupportsAt_Private(snes, part));
  PetscFunctionReturn(0);
}

/*
   Computes the rate at u: the displacements by which the whole path would move u, by the tangent stiffness there. *far: their l2 norm; PETSC_MAX_REAL
   if that is not positive definite. Supports stay. Overwrites path->step. Collective on snes
*/
PetscErrorCode LatinPathRate_Private(SNES snes, const LatinPath *path, Vec u, Vec rate, PetscReal *far)
{
  PetscFunctionBegin;
  PetscCall(VecWAXPY(path->step, -1.0, path->first, path->whole));
  PetscCall(SNESLatinSupportsLoad_Private(snes, u, path->step));
  PetscCall(SNESLatinLargePredict_Private(snes, u, path->step, rate, far));
  PetscFunctionReturn(0);
}

/*
   Whether the equilibrium u is stable: the tangent stiffness is positive definite, tested by forces on all nodes, since symmetric loads on a symmetric
   structure do not show it. Nodes that only slack links hold do not count, unless there are no others. Overwrites path->step. Collective on snes
*/
PetscErrorCode LatinPathStable_Private(SNES snes, const LatinPath *path, Vec u, PetscBool *stable)
{
  const LatinStructure structure = ((SNES_Latin *)snes->data)->large.frame->original;
  PetscReal            moved = 0.0, force, left = PETSC_MAX_REAL;
  KSP                  ksp;
  Mat                  K;
  PetscInt             n;
  Vec                  other, forces;

  PetscFunctionBegin;
  PetscCall(LatinPathForces_Private(path->step));
  PetscCall(DMGetGlobalVector(structure->dm, &other));
  PetscCall(DMGetGlobalVector(structure->dm, &forces));
  PetscCall(SNESLatinLargeTangent_Private(snes, u, &ksp));
  PetscCall(KSPGetOperators(ksp, &K, NULL));
  PetscCall(MatMult(K, path->step, other));
  PetscCall(LatinPathLoose_Private(structure, other, path->step));
  PetscCall(VecNorm(path->step, NORM_2, &force));
  for (PetscInt k = 0; k < LATIN_PATH_REFINEMENTS && moved < PETSC_MAX_REAL && left > LATIN_PATH_RESIDUAL * force; k++) {
    PetscCall(SNESLatinLargePredict_Private(snes, u, path->step, other, &moved));
    PetscCall(MatMult(K, other, forces));
    PetscCall(VecAXPY(path->step, -1.0, forces));
    PetscCall(VecNorm(path->step, NORM_2, &left));
  }
  PetscCall(DMRestoreGlobalVector(structure->dm, &forces));
  PetscCall(DMRestoreGlobalVector(structure->dm, &other));
  PetscCall(VecGetSize(u, &n));
  *stable = (PetscBool)(!n || (force > 0.0 && moved < PETSC_MAX_REAL && left <= LATIN_PATH_RESIDUAL * force));
  PetscFunctionReturn(0);
}

/*
   Whether a path may start from path->u: it is stable, and the least increment moves it by no more than its size; else rounding alone holds it.
   Overwrites path->ahead and path->step. Collective on snes
*/
static PetscErrorCode LatinPathHeld_Private(SNES snes, const LatinPath *path, PetscBool *held)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;
  PetscReal   moved;

  PetscFunctionBegin;
  PetscCall(VecCopy(path->u, snes->vec_sol));
  /* the path begins with these operators; others may hide soft modes */
  if (data->newton.type != LATIN_NEWTON_NEVER) PetscCall(SNESLatinLargeRenew_Private(snes, LATIN_FRAME_TANGENT));
  PetscCall(LatinPathStable_Private(snes, path, path->u, held));
  if (!*held) PetscFunctionReturn(0);
  PetscCall(LatinPathRate_Private(snes, path, path->u, path->ahead, &moved));
  *held = (PetscBool)(LATIN_PATH_LEAST * moved <= data->large.size);
  PetscFunctionReturn(0);
}

/* Sets the first loads of the path to those that the displacements path->u bear. Collective on structure */
static PetscErrorCode LatinPathFirst_Private(LatinStructure structure, const LatinPath *path)
{
  PetscFunctionBegin;
  PetscCall(LatinTurningResidual_Private(structure, NULL, path->u, path->first));
  PetscCall(VecAXPY(path->first, 1.0, structure->load));
  PetscFunctionReturn(0);
}

/* Descends from path->u under this part of the loads. *starts: a stable equilibrium was found, in path->u; else path->u is zero. Collective on snes */
static PetscErrorCode LatinPathDescend_Private(SNES snes, LatinPath *path, PetscReal part, PetscBool *starts)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  PetscCall(LatinPathLoad_Private(snes, path, part));
  PetscCall(SNESLatinLargeDescend_Private(snes, PETSC_FALSE, &path->heavier, path->u, starts));
  if (*starts) {
    PetscCall(SNESLatinLargeFrom_Private(snes, path->u, PETSC_TRUE, NULL));
    *starts = LatinNextSolved(data->next);
    PetscCall(VecCopy(snes->vec_sol, path->u));
  }
  if (*starts) PetscCall(LatinPathHeld_Private(snes, path, starts));
  if (!*starts) PetscCall(VecZeroEntries(path->u));
  else if (part == 1.0) PetscCall(VecCopy(path->whole, path->first)); /* no further loads: what the solve leaves out of balance is none */
  else PetscCall(LatinPathFirst_Private(data->large.frame->original, path));
  PetscFunctionReturn(0);
}

/* Seeks a start under loads (4. of the file), with supports as given. *starts: found, in path->u; else path->u is zero. Collective on snes */
PetscErrorCode LatinPathLoaded_Private(SNES snes, LatinPath *path, PetscBool *starts)
{
  PetscFunctionBegin;
  path->unloaded = *starts = PETSC_FALSE;
  PetscCall(VecZeroEntries(path->u));
  PetscCall(SNESLatinSupportsFrom_Private(snes, ((SNES_Latin *)snes->data)->large.frame->original->prescribed));
  for (PetscReal part = 1.0; part > LATIN_PATH_STIFFENS && !*starts; part *= LATIN_PATH_PART) PetscCall(LatinPathDescend_Private(snes, path, part, starts));
  PetscFunctionReturn(0);
}

/* Seeks a start (2. to 4. of the file) from path->u. *starts: found, in path->u. Collective on snes */
static PetscErrorCode LatinPathStarts_Private(SNES snes, LatinPath *path, PetscBool *starts)
{
  SNES_Latin *data = (SNES_Latin *)snes->data;

  PetscFunctionBegin;
  path->unloaded = PETSC_TRUE;
  PetscCall(LatinPathLoad_Private(snes, path, 0.0));
  PetscCall(VecCopy(path->u, snes->vec_sol));
  PetscCall(SNESLatinLargeRests_Private(snes, starts));
  if (!*starts) {
    PetscCall(SNESLatinLargeProof_Private(snes, path->u, starts));
    *starts = (PetscBool)(*starts && LatinNextSolved(data->next));
    if (*starts) PetscCall(VecCopy(snes->vec_sol, path->u));
  }
  if (*starts) PetscCall(LatinPathHeld_Private(snes, path, starts));
  if (*starts) PetscFunctionReturn(0);
  PetscCall(VecZeroEntries(path->u));
  PetscCall(LatinPathDescend_Private(snes, path, 0.0, starts));
  if (!*starts) PetscCall(LatinPathLoaded_Private(snes, path, starts));
  PetscFunctionReturn(0);
}

/*
   Finds the start of the path. *from: found, in path->u. Supports are where they were at the last solution, at another guess as given, else not
   displaced. Collective on snes
*/
PetscErrorCode LatinPathStart_Private(SNES snes, LatinPath *path, PetscBool *from)
{
  SNES_Latin    *data      = (SNES_Latin *)snes->data;
  LatinStructure structure = data->large.frame->original;
  Vec            rhs       = snes->vec_rhs;
  PetscBool      last;

  PetscFunctionBegin;
  PetscCall(LatinStructureLoads_Private(structure, rhs, path->whole));
  PetscCall(VecZeroEntries(path->first));
  *from = last = SNESLatinWarm(data);
  if (data->guess && data->large.path.solution) PetscCall(VecEqual(snes->vec_sol, data->large.path.solution, &last));
  if (*from || data->guess) {
    PetscCall(VecCopy(*from ? data->large.path.solution : snes->vec_sol, path->u));
    PetscCall(SNESLatinSupportsFrom_Private(snes, last ? data->large.path.held : structure->prescribed));
  }
  if (data->guess) PetscCall(LatinPathHeld_Private(snes, path, from));
  if (*from) PetscCall(LatinPathFirst_Private(structure, path));
  else {
    PetscCall(VecZeroEntries(path->u));
    PetscCall(SNESLatinSupportsFrom_Private(snes, NULL));
    PetscCall(LatinPathStarts_Private(snes, path, from));
  }
  snes->vec_rhs = rhs;
  PetscFunctionReturn(0);
}
