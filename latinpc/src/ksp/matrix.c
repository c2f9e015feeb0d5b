#include "ksp/ksplatinimpl.h"

/* The matrix that a KSP latin solves with: a MATIS and what is known of its unknowns, or the tangent stiffness of a structure. */

/* Coordinates of the unknowns of a MATIS, given to the PC of the solver as they would be to a PC latin, and kept there */
PetscErrorCode KSPLatinSetCoordinates_Private(PC pc, PetscInt dim, PetscInt nodes, PetscReal x[])
{
  Vec          v;
  PetscScalar *a;

  PetscFunctionBegin;
  PetscCheck(dim >= 1 && dim <= 3, PetscObjectComm((PetscObject)pc), PETSC_ERR_ARG_OUTOFRANGE, "Nodes have 1, 2 or 3 coordinates, not %" PetscInt_FMT, dim);
  PetscCall(VecCreate(PetscObjectComm((PetscObject)pc), &v));
  PetscCall(VecSetSizes(v, dim * nodes, PETSC_DETERMINE));
  PetscCall(VecSetBlockSize(v, dim));
  PetscCall(VecSetType(v, VECSTANDARD));
  PetscCall(VecGetArrayWrite(v, &a));
  PetscCall(PetscArraycpy(a, x, dim * nodes));
  PetscCall(VecRestoreArrayWrite(v, &a));
  PetscCall(PetscObjectCompose((PetscObject)pc, "LatinCoordinates", (PetscObject)v));
  PetscCall(VecDestroy(&v));
  PetscFunctionReturn(0);
}

PetscErrorCode KSPLatinSetMatrix_Private(KSP ksp, Mat P)
{
  KSP_Latin         *data = (KSP_Latin *)ksp->data;
  DM                 dm   = ksp->dm;
  Vec                v;
  PetscInt           dim = 0, n = 0;
  const PetscScalar *x = NULL;

  PetscFunctionBegin;
  if (!dm) PetscCall(MatGetDM(P, &dm));
  PetscCall(LatinSetMatrix_Private(data->latin, P));
  PetscCall(PetscObjectQuery((PetscObject)ksp->pc, "LatinCoordinates", (PetscObject *)&v));
  if (v) {
    PetscCall(VecGetBlockSize(v, &dim));
    PetscCall(VecGetLocalSize(v, &n));
    PetscCall(VecGetArrayRead(v, &x));
  }
  PetscCall(LatinUnknownsSetUp_Private(P, dm, dim, dim ? n / dim : 0, x, &data->latin->sub.known));
  if (v) PetscCall(VecRestoreArrayRead(v, &x));
  PetscFunctionReturn(0);
}

/*
   A preconditioner may be that of another matrix; this solver never looks at the entries of its matrix, so they must be
   those of the operators of the subdomains: compared on a vector, unless they come from it.
*/
PetscErrorCode KSPLatinCheckMatrix_Private(KSP ksp, Mat A)
{
  KSP_Latin     *data  = (KSP_Latin *)ksp->data;
  Latin          latin = data->latin;
  const PetscInt n     = latin->sub.bs * latin->sub.copies;
  PetscReal     *v = latin->linear.U, *f = latin->linear.g, norm, difference;
  PetscScalar   *a;

  PetscFunctionBegin;
  if (A == latin->sub.matrix) PetscFunctionReturn(0);
  PetscCall(VecSetRandom(data->work[0], NULL));
  PetscCall(MatMult(A, data->work[0], data->work[1]));
  PetscCall(VecNorm(data->work[1], NORM_2, &norm));
  PetscCall(PetscArrayzero(v, n));
  PetscCall(LatinDistribute_Private(&latin->sub, data->work[0], v));
  PetscCall(LatinOperatorMult(&latin->sub, v, f));
  for (PetscInt i = 0; i < n; i++) f[i] = -f[i];
  PetscCall(VecGetArray(data->work[1], &a));
  PetscCall(LatinSFReduce_Private(latin->sub.dof_sf, 1, MPIU_SCALAR, f, a, MPI_SUM));
  PetscCall(VecRestoreArray(data->work[1], &a));
  PetscCall(VecNorm(data->work[1], NORM_2, &difference));
  PetscCheck(difference <= LatinByPrecision(1e-8, 1e-4) * norm, PetscObjectComm((PetscObject)ksp), PETSC_ERR_ARG_INCOMP,
             "The matrix of -ksp_type latin is not %s: they differ by %g, relative. Another matrix can be solved with -ksp_type cg -pc_type latin",
             latin->sub.structure ? "the tangent stiffness of its structure (LatinStructureComputeJacobian())" : "the MATIS that it is set up from", norm > 0.0 ? (double)(difference / norm) : (double)difference);
  PetscFunctionReturn(0);
}
