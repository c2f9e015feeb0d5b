#include "structure/structureimpl.h"

/* Tangent stiffnesses of the links: kept with the matrix that they make, which may have no entries of its own. */

/* Least and largest stiffness of all links that have one; most may be NULL. Collective on structure */
PetscErrorCode LatinStructureStiffnessRange_Private(LatinStructure structure, PetscReal *least, PetscReal *most)
{
  PetscReal range[2] = {-PETSC_MAX_REAL, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (structure->stiffness[l] > 0.0) range[0] = PetscMax(range[0], -structure->stiffness[l]);
    range[1] = PetscMax(range[1], structure->stiffness[l]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, range, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  *least = -range[0];
  if (most) *most = range[1];
  PetscFunctionReturn(0);
}

/* The tangent stiffnesses that a matrix was made with, NULL if it is none of this structure; borrowed from the matrix */
PetscErrorCode LatinTangentFind_Private(LatinStructure structure, Mat P, Vec *tangent)
{
  PetscInt n, m;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)P, "LatinTangent", (PetscObject *)tangent));
  if (!*tangent) PetscFunctionReturn(0);
  PetscCall(VecGetLocalSize(*tangent, &n));
  PetscCall(VecGetSize(*tangent, &m));
  LatinAgree(PetscObjectComm((PetscObject)structure), n != structure->links_local || m != structure->links_global, PETSC_ERR_ARG_INCOMP,
             "The matrix is the tangent stiffness of a structure of %" PetscInt_FMT " links, and the solver has one of %" PetscInt_FMT ": give it the structure that the matrix comes from", m, structure->links_global);
  PetscFunctionReturn(0);
}

/*
   The tangent stiffness of each link at u, at least `floor`, kept with the matrix J that they make: whoever is given J finds
   them there, and J of another solver has its own. They are borrowed. Collective on structure
*/
PetscErrorCode LatinTangentCompute_Private(LatinStructure structure, Vec u, PetscReal floor, Mat J, Vec *tangent)
{
  Vec                ul;
  const PetscScalar *a;
  PetscScalar       *k;

  PetscFunctionBegin;
  PetscCall(LatinTangentFind_Private(structure, J, tangent));
  if (!*tangent) {
    PetscCall(VecCreate(PetscObjectComm((PetscObject)structure), tangent));
    PetscCall(VecSetSizes(*tangent, structure->links_local, structure->links_global));
    PetscCall(VecSetType(*tangent, VECSTANDARD));
    PetscCall(PetscObjectCompose((PetscObject)J, "LatinTangent", (PetscObject)*tangent));
    PetscCall(PetscObjectDereference((PetscObject)*tangent));
  }
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArrayWrite(*tangent, &k));
  for (PetscInt l = 0; l < structure->links_local; l++) k[l] = PetscMax(floor, LatinStructureTangent(structure, l, LatinStructureElongation(structure, l, a) + structure->e0[l]));
  PetscCall(VecRestoreArrayWrite(*tangent, &k));
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscCall(PetscObjectStateIncrease((PetscObject)J));
  PetscFunctionReturn(0);
}

/* y = B^t k_t B x */
static PetscErrorCode LatinTangentMult_Private(Mat A, Vec x, Vec y)
{
  LatinStructure     structure;
  Vec                xl, yl, tangent;
  const PetscScalar *a, *k;
  PetscScalar       *f;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(A, &structure));
  PetscCall(PetscObjectQuery((PetscObject)A, "LatinTangent", (PetscObject *)&tangent));
  PetscCall(DMGetLocalVector(structure->dm, &xl));
  PetscCall(DMGetLocalVector(structure->dm, &yl));
  PetscCall(VecZeroEntries(xl)); /* no change where prescribed */
  PetscCall(VecZeroEntries(yl));
  PetscCall(DMGlobalToLocalBegin(structure->dm, x, INSERT_VALUES, xl));
  PetscCall(DMGlobalToLocalEnd(structure->dm, x, INSERT_VALUES, xl));
  PetscCall(VecGetArrayRead(xl, &a));
  PetscCall(VecGetArrayRead(tangent, &k));
  PetscCall(VecGetArray(yl, &f));
  for (PetscInt l = 0; l < structure->links_local; l++) LatinStructureAddForce(structure, l, k[l] * LatinStructureElongation(structure, l, a), f);
  PetscCall(VecRestoreArray(yl, &f));
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscCall(VecRestoreArrayRead(xl, &a));
  PetscCall(VecZeroEntries(y));
  if (structure->ground) PetscCall(LatinStructureAddGround_Private(structure, x, y));
  PetscCall(DMLocalToGlobalBegin(structure->dm, yl, ADD_VALUES, y));
  PetscCall(DMLocalToGlobalEnd(structure->dm, yl, ADD_VALUES, y));
  PetscCall(DMRestoreLocalVector(structure->dm, &xl));
  PetscCall(DMRestoreLocalVector(structure->dm, &yl));
  PetscCall(PetscLogFlops(structure->links_local * (5.0 * structure->dim + 1.0)));
  PetscFunctionReturn(0);
}

/* A tangent stiffness without entries, for PC latin, which needs none; LatinTangentCompute_Private() comes before its first use. The structure outlives it. Collective on structure */
PetscErrorCode LatinTangentCreate_Private(LatinStructure structure, Mat *A)
{
  PetscInt n;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(structure->load, &n));
  PetscCall(MatCreateShell(PetscObjectComm((PetscObject)structure), n, n, PETSC_DETERMINE, PETSC_DETERMINE, structure, A));
  PetscCall(MatShellSetOperation(*A, MATOP_MULT, (void (*)(void))LatinTangentMult_Private));
  PetscCall(MatSetOption(*A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* How many links have another tangent stiffness at u, at least `floor`, than in the matrix J */
PetscErrorCode LatinTangentChanges_Private(LatinStructure structure, Vec u, PetscReal floor, Mat J, PetscInt *changes)
{
  Vec                ul, tangent;
  const PetscScalar *a, *k;
  PetscInt           n = 0;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)J, "LatinTangent", (PetscObject *)&tangent));
  PetscCall(DMGetLocalVector(structure->dm, &ul));
  PetscCall(LatinStructureGetLocal_Private(structure, u, ul));
  PetscCall(VecGetArrayRead(ul, &a));
  PetscCall(VecGetArrayRead(tangent, &k));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (PetscMax(floor, LatinStructureTangent(structure, l, LatinStructureElongation(structure, l, a) + structure->e0[l])) != PetscRealPart(k[l])) n++;
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscCall(VecRestoreArrayRead(ul, &a));
  PetscCall(DMRestoreLocalVector(structure->dm, &ul));
  PetscCall(MPIU_Allreduce(&n, changes, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}
