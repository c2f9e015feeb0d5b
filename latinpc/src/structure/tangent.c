#include "structure/structureimpl.h"

/* Tangent stiffnesses of the links, composed as a vector on the tangent matrix B^t k_t B, assembled or a shell: preconditioners read them there. */

/* Computes the least and the largest positive stiffness of all links, of rigid ones the penalty, if any; most may be NULL. Collective on structure */
PetscErrorCode LatinStructureStiffnessRange_Private(LatinStructure structure, PetscReal *least, PetscReal *most)
{
  PetscReal range[2] = {-PETSC_MAX_REAL, 0.0};

  PetscFunctionBegin;
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal k = structure->penalty && LatinLaws[structure->law[l]].rigid ? structure->penalty[l] : structure->stiffness[l];

    if (k > 0.0) range[0] = PetscMax(range[0], -k);
    range[1] = PetscMax(range[1], k);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, range, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  *least = -range[0];
  if (most) *most = range[1];
  PetscFunctionReturn(0);
}

/* Gets the tangent stiffnesses composed on P, borrowed; NULL: none. Checks their number. Collective on structure */
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

/* Computes the tangent stiffness k of each link at u, at least `floor`. Collective on structure */
static PetscErrorCode LatinStructureTangents_Private(LatinStructure structure, Vec u, PetscReal floor, PetscReal k[])
{
  PetscFunctionBegin;
  PetscCall(LatinStructureStrains_Private(structure, u, k));
  for (PetscInt l = 0; l < structure->links_local; l++) k[l] = PetscMax(floor, LatinStructureTangent(structure, l, k[l]));
  PetscFunctionReturn(0);
}

/* Gets the vector of tangent stiffnesses composed on J, borrowed; creates it if there is none. Collective on structure */
static PetscErrorCode LatinTangentLinks_Private(LatinStructure structure, Mat J, Vec *links)
{
  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)J, "LatinTangent", (PetscObject *)links));
  if (*links) PetscFunctionReturn(0);
  PetscCall(VecCreateMPI(PetscObjectComm((PetscObject)structure), structure->links_local, structure->links_global, links));
  PetscCall(PetscObjectCompose((PetscObject)J, "LatinTangent", (PetscObject)*links));
  PetscCall(PetscObjectDereference((PetscObject)*links));
  PetscFunctionReturn(0);
}

/*
   Computes the tangent stiffness of each link at u, at least `floor`, and composes them on the matrix J; each solver has its own J. *tangent is
   borrowed. Collective on structure
*/
PetscErrorCode LatinTangentCompute_Private(LatinStructure structure, Vec u, PetscReal floor, Mat J, Vec *tangent)
{
  PetscReal *k;

  PetscFunctionBegin;
  PetscCall(LatinTangentFind_Private(structure, J, tangent));
  PetscCall(LatinTangentLinks_Private(structure, J, tangent));
  PetscCall(VecGetArrayWrite(*tangent, &k));
  PetscCall(LatinStructureTangents_Private(structure, u, floor, k));
  PetscCall(VecRestoreArrayWrite(*tangent, &k));
  PetscCall(PetscObjectStateIncrease((PetscObject)J));
  PetscFunctionReturn(0);
}

/* Sets the tangent stiffnesses of the shell matrix J to k, [links_local]. Collective on structure */
PetscErrorCode LatinTangentGive_Private(LatinStructure structure, const PetscReal k[], Mat J)
{
  PetscScalar *a;
  Vec          tangent;

  PetscFunctionBegin;
  PetscCall(LatinTangentLinks_Private(structure, J, &tangent));
  PetscCall(VecGetArrayWrite(tangent, &a));
  PetscCall(PetscArraycpy(a, k, structure->links_local));
  PetscCall(VecRestoreArrayWrite(tangent, &a));
  PetscCall(PetscObjectStateIncrease((PetscObject)J));
  PetscFunctionReturn(0);
}

/* y = B^t k_t B x */
static PetscErrorCode LatinTangentMult_Private(Mat A, Vec x, Vec y)
{
  LatinStructure   structure;
  Vec              tangent;
  const PetscReal *k;
  PetscReal       *tension;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(A, &structure));
  PetscCall(PetscObjectQuery((PetscObject)A, "LatinTangent", (PetscObject *)&tangent));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscCall(LatinStructureElongations_Private(structure, NULL, x, tension)); /* zero where prescribed */
  PetscCall(VecGetArrayRead(tangent, &k));
  for (PetscInt l = 0; l < structure->links_local; l++) tension[l] *= k[l];
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscCall(LatinStructureForces_Private(structure, tension, x, NULL, y));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &tension));
  PetscFunctionReturn(0);
}

/*
   Creates the tangent stiffness as a shell matrix, for PC latin, which needs no entries. Call LatinTangentCompute_Private() before its first use. The
   structure must outlive it. Collective on structure
*/
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

/* Counts the links whose tangent stiffness at u, at least `floor`, differs from that in J. Collective on structure */
PetscErrorCode LatinTangentChanges_Private(LatinStructure structure, Vec u, PetscReal floor, Mat J, PetscInt *changes)
{
  Vec              tangent;
  const PetscReal *k;
  PetscReal       *here;

  PetscFunctionBegin;
  *changes = 0;
  PetscCall(PetscObjectQuery((PetscObject)J, "LatinTangent", (PetscObject *)&tangent));
  PetscCall(DMGetWorkArray(structure->dm, structure->links_local, MPIU_REAL, &here));
  PetscCall(LatinStructureTangents_Private(structure, u, floor, here));
  PetscCall(VecGetArrayRead(tangent, &k));
  for (PetscInt l = 0; l < structure->links_local; l++)
    if (here[l] != k[l]) ++*changes;
  PetscCall(VecRestoreArrayRead(tangent, &k));
  PetscCall(DMRestoreWorkArray(structure->dm, structure->links_local, MPIU_REAL, &here));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, changes, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}
