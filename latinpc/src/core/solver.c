#include "core/latinimpl.h"

/*
   Common part of the PC, the KSP and the SNES of type latin: check of the type, prefix, structure, coordinates, and set-up for the matrix of a PC or a
   KSP.
*/

/* Checks that solver is of type latin. Collective on solver */
PetscErrorCode LatinCheckType_Private(PetscObject solver)
{
  PetscBool is;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare(solver, "latin", &is));
  PetscCheck(is, PetscObjectComm(solver), PETSC_ERR_ARG_WRONG, "The %s is of type %s, not latin: call %sSetType() first", solver->class_name, solver->type_name ? solver->type_name : "(not set)", solver->class_name);
  PetscFunctionReturn(0);
}

/* Sets options database and prefix of latin to those of solver; appends pc_latin_, ksp_latin_ or snes_latin_ */
PetscErrorCode LatinSetPrefix_Private(Latin latin, PetscObject solver)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectSetOptions((PetscObject)latin, solver->options));
  PetscCall(PetscObjectSetOptionsPrefix((PetscObject)latin, solver->prefix));
  PetscCall(PetscObjectAppendOptionsPrefix((PetscObject)latin, solver->classid == SNES_CLASSID ? "snes_latin_" : solver->classid == KSP_CLASSID ? "ksp_latin_" : "pc_latin_"));
  PetscFunctionReturn(0);
}

/* Attaches a structure to a PC or a KSP, in place of that of its matrix. latin: NULL if solver is not of type latin. Collective on solver */
PetscErrorCode LatinAttach_Private(Latin latin, PetscObject solver, LatinStructure structure)
{
  PetscObject before;

  PetscFunctionBegin;
  PetscCall(LatinStructureCheckSetUp_Private(structure));
  PetscCall(LatinStructureCheckComm_Private(structure, solver));
  PetscCall(PetscObjectQuery(solver, "LatinStructure", &before));
  if (latin && (PetscObject)structure != before) latin->stale = PETSC_TRUE;
  PetscCall(PetscObjectCompose(solver, "LatinStructure", (PetscObject)structure));
  PetscFunctionReturn(0);
}

/* PCSetCoordinates() of a PC latin, or of the PC of a KSP latin: composes the coordinates x, [nodes][dim], on the PC. Collective on pc */
PetscErrorCode LatinSetCoordinates_Private(PC pc, PetscInt dim, PetscInt nodes, PetscReal x[])
{
  Vec          v;
  PetscScalar *a;

  PetscFunctionBegin;
  if (!dim) PetscFunctionReturn(0); /* PCFIELDSPLIT passes none to its fields */
  PetscCheck(dim >= 1 && dim <= 3, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_OUTOFRANGE, "Nodes have 1, 2 or 3 coordinates, not %" PetscInt_FMT, dim);
  PetscCall(VecCreateMPI(PetscObjectComm((PetscObject)pc), dim * nodes, PETSC_DETERMINE, &v));
  PetscCall(VecSetBlockSize(v, dim));
  PetscCall(VecGetArrayWrite(v, &a));
  PetscCall(PetscArraycpy(a, x, dim * nodes));
  PetscCall(VecRestoreArrayWrite(v, &a));
  PetscCall(PetscObjectCompose((PetscObject)pc, "LatinCoordinates", (PetscObject)v));
  PetscCall(VecDestroy(&v));
  pc->setupcalled = 0; /* built again at the next PCSetUp() */
  PetscFunctionReturn(0);
}

/*
   Sets latin up for the matrix of pc, the PC itself or that of the KSP `solver`: the tangent stiffness of a structure, attached to solver, to dm (its DM,
   or NULL) or to the DM of the matrix; else a MATIS. Unless latin->renews, solver has reset latin. Collective on solver
*/
PetscErrorCode LatinSetUpOperator_Private(Latin latin, PetscObject solver, PC pc, DM dm)
{
  LatinStructure structure;
  PetscBool      matis, assembled;
  PetscInt       rows, dofs;
  DM             behind;
  Vec            coordinates;

  PetscFunctionBegin;
  PetscCall(MatAssembled(pc->pmat, &assembled));
  PetscCheck(assembled, PetscObjectComm(solver), PETSC_ERR_ORDER, "-%s_type latin has no matrix yet: call KSPSetOperators(). The KSP of a SNES gets the Jacobian in SNESSolve(); to set it up before, call SNESComputeJacobian() and KSPSetOperators()",
             solver->classid == KSP_CLASSID ? "ksp" : "pc");
  PetscCall(MatGetDM(pc->pmat, &behind));
  PetscCall(PetscObjectQuery(solver, "LatinStructure", (PetscObject *)&structure));
  if (!structure) PetscCall(LatinStructureFromDM_Private(dm, &structure));
  if (!structure) PetscCall(LatinStructureFromDM_Private(behind, &structure));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc->pmat, MATIS, &matis));
  PetscCheck(
    structure || matis, PetscObjectComm(solver), PETSC_ERR_ORDER,
    "-%s_type latin has no structure to work on: call LatinStructureAttach%s() (in Python, latinpc.Structure(...).attach()), or build the matrix from the DM of a structure (LatinStructureCreate(), LatinStructureAttachSNES()). Or assemble it as a MATIS (-dm_mat_type is, MatCreateIS()): this matrix, of type %s, no longer has the matrices of its subdomains",
    solver->classid == KSP_CLASSID ? "ksp" : "pc", solver->class_name, ((PetscObject)pc->pmat)->type_name);
  if (structure) {
    PetscCall(LatinStructureCheckLinear_Private(structure, "PC latin and KSP latin are for"));
    PetscCall(MatGetLocalSize(pc->pmat, &rows, NULL));
    PetscCall(VecGetLocalSize(structure->load, &dofs));
    LatinAgree(PetscObjectComm(solver), rows != dofs, PETSC_ERR_ARG_SIZ,
               "The matrix of -%s_type latin has %" PetscInt_FMT " rows on a rank where its structure has %" PetscInt_FMT " free degrees of freedom; make it with DMCreateMatrix() on the DM of the structure",
               solver->classid == KSP_CLASSID ? "ksp" : "pc", rows, dofs);
  }
  PetscCall(LatinSetProblem_Private(latin, structure, structure ? NULL : pc->pmat));
  PetscCall(PetscObjectQuery((PetscObject)pc, "LatinCoordinates", (PetscObject *)&coordinates));
  if (structure) PetscCall(LatinSetStiffness_Private(latin, pc->pmat));
  else PetscCall(LatinUnknownsSetUp_Private(pc->pmat, dm ? dm : behind, coordinates, &latin->sub.known));
  PetscCall(LatinSetPrefix_Private(latin, solver));
  PetscCall(LatinSetUp_Private(latin));
  PetscFunctionReturn(0);
}
