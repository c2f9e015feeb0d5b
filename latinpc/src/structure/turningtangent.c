#include "structure/turned.h"

/*
   The tangent stiffness of rotating links: assembled, or matrix-free, by products link by link, which need less memory and no assembly.
*/

/*
   Computes the stiffness of slack cables: structure->hold times the mean tension over length of taut links; 0 without structure->ahead. Collective on
   structure
*/
static PetscErrorCode LatinTurnedHold_Private(LatinStructure structure, const PetscScalar a[], PetscReal *hold)
{
  PetscReal   sum[3] = {0.0, 0.0, 0.0};
  LatinTurned link;

  PetscFunctionBegin;
  *hold = 0.0;
  if (!structure->ahead) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (LatinStructureKeeps(structure, l)) continue;
    LatinTurnedLink(structure, NULL, l, a, &link);
    sum[0] += PetscMax(link.across, 0.0);
    sum[1] += link.across > 0.0 ? 1.0 : 0.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  if (sum[1] > 0.0) *hold = structure->hold * sum[0] / sum[1];
  PetscFunctionReturn(0);
}

/* Computes block, the derivative of the force of link l by d, [dim][dim], row by row. hold: stiffness of slack cables. Not symmetric in a time step */
static void LatinTurnedBlock(LatinStructure structure, PetscInt l, const PetscScalar a[], PetscReal hold, PetscReal block[])
{
  const PetscInt dim = structure->dim;
  LatinTurned    link;

  LatinTurnedLink(structure, NULL, l, a, &link);
  if (!structure->midpoint) {
    const PetscBool holds = (PetscBool)(structure->ahead && !structure->slope && link.size > 0.0); /* size: not with a fixed direction */
    PetscReal       k     = structure->slope ? structure->slope[l] : LatinStructureTangent(structure, l, structure->strain ? structure->strain[l] : link.x);

    link.across = LatinTurnedAcross(structure, l, link.size, k, link.across);
    if (holds && (k == 0.0 || link.across >= 0.0)) { /* not in compression */
      link.across = PetscMax(link.across, hold);
      k           = PetscMax(k, hold);
    }
    if (structure->slope && structure->slope[l] == LATIN_SLACK) k = link.across = 0.0;
    for (PetscInt c = 0; c < dim; c++) link.change[c] = (k - link.across) * link.n[c];
  }
  for (PetscInt i = 0; i < dim * dim; i++) block[i] = link.n[i / dim] * link.change[i % dim] + (i / dim == i % dim ? link.across : 0.0);
}

/* Assembles the tangent stiffness at u in J. Collective on structure */
PetscErrorCode LatinTurningJacobian_Private(LatinStructure structure, Vec u, Mat J)
{
  const PetscScalar *a;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(MatZeroEntries(J));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal k[9];

    LatinTurnedBlock(structure, l, a, 0.0, k);
    PetscCall(LatinTurnedAdd_Private(structure, l, k, J));
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  if (structure->ground) PetscCall(MatDiagonalSet(J, structure->ground, ADD_VALUES));
  PetscCall(MatSetOption(J, MAT_SYMMETRIC, structure->midpoint ? PETSC_FALSE : PETSC_TRUE));
  if (!structure->midpoint) PetscCall(MatSetOption(J, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* Computes r: tangent stiffness at u times displacements `held` of prescribed vertices, [vertices][dim]. Collective on structure */
PetscErrorCode LatinTurningHeld_Private(LatinStructure structure, Vec u, const PetscReal held[], Vec r)
{
  const PetscInt     dim = structure->dim;
  const PetscScalar *a;
  PetscReal         *f;
  Vec                local;

  PetscFunctionBegin;
  PetscCall(DMGetWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal *first = held + dim * structure->ends[2 * l], *second = held + dim * structure->ends[2 * l + 1];
    PetscReal        k[9];

    LatinTurnedBlock(structure, l, a, 0.0, k);
    for (PetscInt i = 0; i < dim; i++) {
      f[dim * l + i] = 0.0;
      for (PetscInt c = 0; c < dim; c++) f[dim * l + i] += k[dim * i + c] * (second[c] - first[c]);
    }
  }
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(LatinTurningForces_Private(structure, f, u, NULL, r));
  PetscCall(DMRestoreWorkArray(structure->dm, dim * structure->links_local, MPIU_REAL, &f));
  PetscFunctionReturn(0);
}

/* ---- matrix-free ---- */
/* Adds to v, [vertices][dim], the forces of the links: their blocks k times the vertex displacements a. Inlined with a constant dim */
static inline void LatinTurnedProducts(LatinStructure structure, PetscInt dim, const PetscScalar k[], const PetscScalar a[], PetscScalar v[])
{
  for (PetscInt l = 0; l < structure->links_local; l++, k += dim * dim) {
    const PetscInt first = dim * structure->ends[2 * l], second = dim * structure->ends[2 * l + 1];
    PetscScalar    d[3], f[3];

    for (PetscInt c = 0; c < dim; c++) d[c] = a[second + c] - a[first + c];
    for (PetscInt i = 0; i < dim; i++) {
      f[i] = 0.0;
      for (PetscInt c = 0; c < dim; c++) f[i] += k[dim * i + c] * d[c];
    }
    for (PetscInt i = 0; i < dim; i++) v[first + i] -= f[i];
    for (PetscInt i = 0; i < dim; i++) v[second + i] += f[i];
  }
}

static PetscErrorCode LatinTurningMult_Private(Mat A, Vec x, Vec y)
{
  LatinStructure     structure;
  Vec                blocks, local, forces;
  const PetscScalar *k, *a;
  PetscScalar       *v;

  PetscFunctionBegin;
  PetscCall(MatShellGetContext(A, &structure));
  PetscCall(PetscObjectQuery((PetscObject)A, "LatinBlocks", (PetscObject *)&blocks));
  PetscCall(LatinStructureOpenForces_Private(structure, &forces, &v));
  PetscCall(VecGetArrayRead(blocks, &k));
  PetscCall(LatinStructureOpen_Private(structure, NULL, x, &local, &a)); /* zero at prescribed vertices */
  if (structure->dim == 3) LatinTurnedProducts(structure, 3, k, a, v);
  else LatinTurnedProducts(structure, structure->dim, k, a, v);
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(VecRestoreArrayRead(blocks, &k));
  PetscCall(LatinStructureCloseForces_Private(structure, &forces, &v, x, NULL, y));
  PetscFunctionReturn(0);
}

/*
   Creates the matrix-free tangent stiffness. Call LatinTurningMatCompute_Private() before its first use; the structure must outlive it. Collective on
   structure
*/
PetscErrorCode LatinTurningMatCreate_Private(LatinStructure structure, Mat *A)
{
  const PetscInt m = structure->dim * structure->dim * structure->links_local;
  PetscInt       n;
  Vec            blocks;

  PetscFunctionBegin;
  PetscCall(VecGetLocalSize(structure->load, &n));
  PetscCall(MatCreateShell(PetscObjectComm((PetscObject)structure), n, n, PETSC_DETERMINE, PETSC_DETERMINE, structure, A));
  PetscCall(MatShellSetOperation(*A, MATOP_MULT, (void (*)(void))LatinTurningMult_Private));
  if (!structure->midpoint) PetscCall(MatSetOption(*A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(VecCreateSeq(PETSC_COMM_SELF, m, &blocks));
  PetscCall(PetscObjectCompose((PetscObject)*A, "LatinBlocks", (PetscObject)blocks));
  PetscCall(VecDestroy(&blocks));
  PetscFunctionReturn(0);
}

/* Computes the blocks of the matrix-free tangent stiffness at u. Collective on structure */
PetscErrorCode LatinTurningMatCompute_Private(LatinStructure structure, Vec u, Mat A)
{
  Vec                blocks, local;
  PetscScalar       *k;
  const PetscScalar *a;
  PetscReal          hold;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery((PetscObject)A, "LatinBlocks", (PetscObject *)&blocks));
  PetscCall(VecGetArrayWrite(blocks, &k));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, u, &local, &a));
  PetscCall(LatinTurnedHold_Private(structure, a, &hold));
  for (PetscInt l = 0; l < structure->links_local; l++) LatinTurnedBlock(structure, l, a, hold, k + structure->dim * structure->dim * l);
  PetscCall(LatinStructureClose_Private(structure, &local, &a));
  PetscCall(VecRestoreArrayWrite(blocks, &k));
  PetscCall(PetscObjectStateIncrease((PetscObject)A));
  PetscFunctionReturn(0);
}
