#include "structure/structureimpl.h"
#include <petsc/private/snesimpl.h>
#include <petscts.h>

/* Structures and PETSc's solvers: look-up of the structure of a DM or a SNES, and the callbacks of a SNES. */

/* Gets the structure composed on a DM, NULL: none; dm may be NULL. The structure's own DM has a pointer to it, that of a solver a reference */
PetscErrorCode LatinStructureFromDM_Private(DM dm, LatinStructure *structure)
{
  PetscObject found = NULL;

  PetscFunctionBegin;
  if (dm) PetscCall(PetscObjectQuery((PetscObject)dm, "LatinStructure", &found));
  if (found && found->classid == PETSC_CONTAINER_CLASSID) PetscCall(PetscContainerGetPointer((PetscContainer)found, (void **)&found));
  *structure = (LatinStructure)found;
  PetscFunctionReturn(0);
}

/* Gets the structure of the DM of a SNES, which SNESSetDM() may have replaced, else the attached one; NULL: none */
PetscErrorCode SNESLatinFindStructure_Private(SNES snes, LatinStructure *structure)
{
  PetscFunctionBegin;
  PetscCall(LatinStructureFromDM_Private(snes->dm, structure));
  if (!*structure) PetscCall(PetscObjectQuery((PetscObject)snes, "LatinStructure", (PetscObject *)structure));
  PetscFunctionReturn(0);
}

/* Gets the tensions of rigid links, borrowed from the solver; NULL without rigid links or if they are springs. An error if the solver has none */
PetscErrorCode LatinSolverRigid_Private(SNES snes, LatinStructure structure, const PetscReal *rigid[])
{
  PetscErrorCode (*get)(SNES, const PetscReal *[]) = NULL;

  PetscFunctionBegin;
  *rigid = NULL;
  if (structure->rigid_law < 0 || structure->penalty) PetscFunctionReturn(0);
  PetscCall(PetscObjectQueryFunction((PetscObject)snes, "LatinRigidTensions_C", &get));
  if (!get) PetscCall(LatinStructureCheckRigid_Private(structure, ((PetscObject)snes)->type_name ? ((PetscObject)snes)->type_name : "SNES"));
  PetscCall((*get)(snes, rigid));
  PetscFunctionReturn(0);
}

/* Computes the tensions of all links, [links_local]: of elastic ones by their law at u, of rigid ones from the solver. Collective on structure */
PetscErrorCode LatinSolverTensions_Private(SNES snes, LatinStructure structure, Vec u, PetscReal tension[])
{
  const PetscReal *rigid;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(LatinSolverRigid_Private(snes, structure, &rigid));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureTensions_Private(structure, rigid, u, tension));
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinStructureFunction_SNES(SNES snes, Vec u, Vec r, void *ctx)
{
  LatinStructure   structure = (LatinStructure)ctx;
  const PetscReal *rigid;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckVec_Private(structure, u));
  PetscCall(LatinSolverRigid_Private(snes, structure, &rigid));
  LatinWatch(PetscObjectComm((PetscObject)structure), LatinStructureResidual_Private(structure, rigid, u, r));
  PetscFunctionReturn(0);
}

/* Computes the unbalance r of the structure at u, less the right-hand side of snes, also if the user has set another function. Collective on snes */
PetscErrorCode LatinSolverUnbalance_Private(SNES snes, LatinStructure structure, Vec u, Vec r)
{
  PetscErrorCode (*function)(SNES, Vec, Vec, void *);

  PetscFunctionBegin;
  PetscCall(SNESGetFunction(snes, NULL, &function, NULL));
  if (function == LatinStructureFunction_SNES) PetscCall(SNESComputeFunction(snes, u, r));
  else {
    PetscCall(LatinStructureFunction_SNES(snes, u, r, structure));
    if (snes->vec_rhs) PetscCall(VecAXPY(r, -1.0, snes->vec_rhs));
  }
  PetscFunctionReturn(0);
}

/* Jacobian of a SNES: assembles P. snes may be NULL, as from a TS */
PetscErrorCode LatinStructureJacobian_SNES(SNES snes, Vec u, Mat J, Mat P, void *ctx)
{
  (void)snes;
  PetscFunctionBegin;
  PetscCall(LatinStructureComputeJacobian((LatinStructure)ctx, u, P));
  if (J != P) {
    PetscCall(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinNothing_SNES(SNES snes, Vec u, PetscReal *energy, void *ctx)
{
  (void)snes;
  (void)u;
  (void)ctx;
  *energy = 0.0;
  return 0;
}

/* Whether PETSc itself subtracts the work of the right-hand side b of F(u) = b from an objective: 3.18 does not, 3.26 does. Not collective */
static PetscErrorCode LatinObjectiveHasWork_Private(PetscBool *has)
{
  static PetscInt known = -1; /* the same for all SNES */
  PetscReal       energy;
  SNES            snes;
  Vec             one;

  PetscFunctionBegin;
  if (known < 0) {
    PetscCall(VecCreateSeq(PETSC_COMM_SELF, 1, &one));
    PetscCall(VecSet(one, 1.0));
    PetscCall(SNESCreate(PETSC_COMM_SELF, &snes));
    PetscCall(SNESSetObjective(snes, LatinNothing_SNES, NULL));
    snes->vec_rhs = one;
    PetscCall(SNESComputeObjective(snes, one, &energy));
    snes->vec_rhs = NULL;
    PetscCall(SNESDestroy(&snes));
    PetscCall(VecDestroy(&one));
    known = energy != 0.0 ? 1 : 0;
  }
  *has = (PetscBool)known;
  PetscFunctionReturn(0);
}

/* Objective: energy minus the work of the right-hand side b of F(u) = b. Its gradient is the function of line searches */
static PetscErrorCode LatinStructureObjective_SNES(SNES snes, Vec u, PetscReal *energy, void *ctx)
{
  PetscScalar work = 0.0;
  PetscBool   has  = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinStructureComputeEnergy((LatinStructure)ctx, u, energy));
  if (!snes || !snes->vec_rhs) PetscFunctionReturn(0);
  PetscCall(LatinObjectiveHasWork_Private(&has));
  if (!has) PetscCall(VecDot(snes->vec_rhs, u, &work));
  *energy -= PetscRealPart(work);
  PetscFunctionReturn(0);
}

/* Removes the objective of a SNES: SNESSetObjective() ignores NULL. Collective on snes */
PetscErrorCode LatinNoObjective_Private(SNES snes)
{
  DMSNES callbacks;
  DM     dm;

  PetscFunctionBegin;
  PetscCall(SNESGetDM(snes, &dm));
  PetscCall(DMGetDMSNESWrite(dm, &callbacks));
  callbacks->ops->computeobjective = NULL;
  PetscFunctionReturn(0);
}

/* Sets residual, Jacobian and energy of the structure in snes. Collective on snes */
static PetscErrorCode LatinStructureEquations_Private(LatinStructure structure, SNES snes)
{
  PetscFunctionBegin;
  PetscCall(SNESSetFunction(snes, NULL, LatinStructureFunction_SNES, structure));
  PetscCall(SNESSetJacobian(snes, NULL, NULL, LatinStructureJacobian_SNES, structure));
  PetscCall(SNESSetObjective(snes, LatinStructureObjective_SNES, structure));
  if (structure->midpoint) PetscCall(LatinNoObjective_Private(snes)); /* the mean forces of a time step have no potential */
  PetscFunctionReturn(0);
}

/* Sets them unless snes has them, or a function of the user: after SNESSetDM() it has none, or those of the last DM. Collective on snes */
PetscErrorCode SNESLatinFollowDM_Private(SNES snes, LatinStructure structure)
{
  PetscErrorCode (*function)(SNES, Vec, Vec, void *);
  void *ctx;

  PetscFunctionBegin;
  PetscCall(SNESGetFunction(snes, NULL, &function, &ctx));
  PetscCheck(function != SNESTSFormFunction, PetscObjectComm((PetscObject)snes), PETSC_ERR_SUP, "-snes_type latin solves static structures, and the steps of -ts_type latin: for other integrators take -snes_type newtonls");
  if (!function || (function == LatinStructureFunction_SNES && ctx != structure)) PetscCall(LatinStructureEquations_Private(structure, snes));
  PetscFunctionReturn(0);
}

/*@C
  LatinStructureAttachSNES - Sets the DM, the residual, the Jacobian and the energy of a structure in a SNES.

  Collective on snes; the SNES keeps a reference to the structure. Attaching another structure resets the SNES

  Input Parameters:
+ structure - set up
- snes      - of any type, on the communicator of the structure

  Level: beginner

  Note:
  Any SNES type then solves it: `-snes_type latin`, or `-snes_type newtonls` with any `-pc_type`. A SNES without a DM of the
  structure gets a clone, so that settings of its DM do not affect other solvers of the structure.

.seealso: `LatinStructureCreate()`, `LatinStructureAttachTS()`, `LatinStructureAttachKSP()`, `LatinStructureAttachPC()`
@*/
PetscErrorCode LatinStructureAttachSNES(LatinStructure structure, SNES snes)
{
  LatinStructure before, attached = NULL, behind;
  DM             dm;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckSetUp_Private(structure));
  PetscValidHeaderSpecific(snes, SNES_CLASSID, 2);
  PetscCall(LatinStructureCheckFreeUnlinked_Private(structure));
  PetscCall(LatinStructureCheckComm_Private(structure, (PetscObject)snes));
  PetscCall(SNESLatinFindStructure_Private(snes, &before));
  PetscCall(PetscObjectQuery((PetscObject)snes, "LatinStructure", (PetscObject *)&attached));
  /* set up for another structure, which SNESSetDM() may have hidden */
  if ((before && before != structure) || (attached && attached != structure)) PetscCall(SNESReset(snes));
  PetscCall(LatinStructureFromDM_Private(snes->dm, &behind));
  if (behind != structure) {
    PetscCall(LatinStructureCloneDM_Private(structure, &dm));
    PetscCall(PetscObjectCompose((PetscObject)dm, "LatinStructure", (PetscObject)structure));
    PetscCall(SNESSetDM(snes, dm));
    PetscCall(DMDestroy(&dm));
  }
  PetscCall(LatinStructureEquations_Private(structure, snes));
  PetscCall(PetscObjectCompose((PetscObject)snes, "LatinStructure", (PetscObject)structure));
  PetscFunctionReturn(0);
}
