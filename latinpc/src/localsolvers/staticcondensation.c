#include "localsolvers/latinlocalsolvers.h"

/*
   The inside of a subdomain, eliminated before anything else is built. Where interfaces are short against what is
   inside, one factor is enough: with I the unknowns of one subdomain alone and G the others,

     S = K_GG - K_GI K_II^-1 K_IG

   takes the place of the operator, and the copies of the other stages are those of G. Search directions, macro fields and
   the operator with springs (28) are then dense and small. A preconditioner eliminates the inside before a linear stage,
   and finds it again after it, by the same factor.

   For a matrix with one subdomain on this rank, if the solvers of its subdomains are the default ones.
*/

#define LATIN_INTERIOR_WIDTH 320    /* most unknowns on interfaces: what follows is dense */
#define LATIN_INTERIOR_WORK  120000 /* most of them times unknowns inside */

struct _n_LatinInterior {
  PetscInt   n;       /* unknowns inside */
  PetscInt  *row;     /* [n] where they are in this rank's part of a vector */
  PetscInt  *ki, *kj; /* K_II by rows */
  PetscReal *ka;
  PetscInt  *ci, *cj; /* K_IG by rows, columns are copies */
  PetscReal *ca;
  Mat        K;
  KSP        ksp;
  Vec        b, x;
  PetscReal *y; /* [n] what the forces inside move, interfaces held */
};

PetscErrorCode LatinInteriorReset(LatinInterior *interior)
{
  PetscFunctionBegin;
  if (!*interior) PetscFunctionReturn(0);
  PetscCall(KSPDestroy(&(*interior)->ksp));
  PetscCall(MatDestroy(&(*interior)->K));
  PetscCall(VecDestroy(&(*interior)->b));
  PetscCall(VecDestroy(&(*interior)->x));
  PetscCall(PetscFree4((*interior)->row, (*interior)->ki, (*interior)->ci, (*interior)->y));
  PetscCall(PetscFree4((*interior)->kj, (*interior)->ka, (*interior)->cj, (*interior)->ca));
  PetscCall(PetscFree(*interior));
  PetscFunctionReturn(0);
}

/* at[copy]: its number among those inside, or -1 - its number among the others. Does it pay here? */
static PetscErrorCode LatinInteriorNumber_Private(const LatinSubdomains *sub, PetscInt at[], PetscInt *inside, PetscBool *pays)
{
  PetscInt    n = 0, width = 0, first;
  PetscLayout map;

  PetscFunctionBegin;
  *pays = PETSC_FALSE;
  if (sub->n != 1 || sub->trace) PetscFunctionReturn(0);
  PetscCall(MatGetLayouts(sub->matrix, &map, NULL));
  PetscCall(PetscLayoutGetRange(map, &first, NULL));
  for (PetscInt i = 0; i < sub->copies; i++) {
    at[i] = sub->multiplicity[i] > 1 ? -1 - width++ : n++;
    if (at[i] >= 0 && (sub->node[i] < first || sub->node[i] >= first + sub->nodes_local)) PetscFunctionReturn(0); /* another rank has it in its part of a vector */
  }
  *inside = n;
  *pays   = (PetscBool)(n && width && width <= LATIN_INTERIOR_WIDTH && width * n <= LATIN_INTERIOR_WORK);
  PetscFunctionReturn(0);
}

/* The rows of K_II and K_IG */
static PetscErrorCode LatinInteriorRows_Private(const LatinSubdomains *sub, const PetscInt at[], LatinInterior interior)
{
  PetscInt    first, nk = 0, nc = 0;
  PetscLayout map;

  PetscFunctionBegin;
  PetscCall(MatGetLayouts(sub->matrix, &map, NULL));
  PetscCall(PetscLayoutGetRange(map, &first, NULL));
  PetscCall(PetscMalloc4(interior->n, &interior->row, interior->n + 1, &interior->ki, interior->n + 1, &interior->ci, interior->n, &interior->y));
  for (PetscInt i = 0; i < sub->copies; i++)
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1] && at[i] >= 0; k++) {
      if (at[sub->kj[k]] >= 0) nk++;
      else nc++;
    }
  PetscCall(PetscMalloc4(nk, &interior->kj, nk, &interior->ka, nc, &interior->cj, nc, &interior->ca));
  nk = nc = 0;
  for (PetscInt i = 0; i < sub->copies; i++) {
    if (at[i] < 0) continue;
    interior->row[at[i]] = sub->node[i] - first;
    interior->ki[at[i]]  = nk;
    interior->ci[at[i]]  = nc;
    for (PetscInt k = sub->ki[i]; k < sub->ki[i + 1]; k++) {
      const PetscInt j = at[sub->kj[k]];

      if (j >= 0) {
        interior->kj[nk]   = j;
        interior->ka[nk++] = sub->ka[k];
      } else {
        interior->cj[nc]   = -1 - j;
        interior->ca[nc++] = sub->ka[k];
      }
    }
  }
  interior->ki[interior->n] = nk;
  interior->ci[interior->n] = nc;
  PetscFunctionReturn(0);
}

/* Factors K_II; *done: by a factorisation, and nothing inside moves by itself, which the stages to come would report with names */
static PetscErrorCode LatinInteriorFactor_Private(const LatinSubdomains *sub, LatinInterior interior, PetscBool *done)
{
  LatinFactorStatus status = {.large = (PetscBool)(interior->n > LATIN_LARGE)};
  PC                pc;

  PetscFunctionBegin;
  PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, interior->n, interior->n, interior->ki, interior->kj, interior->ka, &interior->K));
  PetscCall(MatSetOption(interior->K, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(interior->K, MAT_SPD, PETSC_TRUE));
  PetscCall(MatCreateVecs(interior->K, &interior->x, &interior->b));
  PetscCall(LatinSolverCreate_Private(PETSC_COMM_SELF, sub->object, "interior", &interior->ksp));
  PetscCall(KSPGetPC(interior->ksp, &pc));
  PetscCall(LatinDirectSolver_Private(pc, interior->K, MATSOLVERCHOLMOD));
  PetscCall(KSPSetOperators(interior->ksp, interior->K, interior->K));
  PetscCall(KSPSetFromOptions(interior->ksp));
  PetscCall(LatinFactor_Private(interior->ksp, interior->K, MATSOLVERCHOLMOD, &status));
  PetscCall(VecDestroy(&status.mode));
  *done = (PetscBool)!LatinFactorFailed(&status);
  PetscFunctionReturn(0);
}

/* The copies on interfaces take the places of all, and S that of their operator */
static PetscErrorCode LatinInteriorShrink_Private(LatinSubdomains *sub, const PetscInt at[], PetscInt width, const PetscReal S[])
{
  const PetscInt copies = sub->copies, dim = sub->dim;

  PetscFunctionBegin;
  for (PetscInt i = 0, k = 0; i < copies; i++) {
    if (at[i] >= 0) continue;
    sub->node[k]         = sub->node[i];
    sub->field[k]        = sub->field[i];
    sub->fixed[k]        = sub->fixed[i];
    sub->prescribed[k]   = sub->prescribed[i];
    sub->multiplicity[k] = sub->multiplicity[i];
    sub->global_dof[k]   = sub->global_dof[i];
    for (PetscInt d = 0; d < dim; d++) sub->x[dim * k + d] = sub->x[dim * i + d];
    k++;
  }
  for (PetscInt v = 0; v < sub->nears; v++)
    for (PetscInt i = 0, k = 0; i < copies; i++)
      if (at[i] < 0) sub->near[width * v + k++] = sub->near[copies * v + i];
  sub->copies         = width;
  sub->node_offset[1] = width;
  PetscCall(PetscFree(sub->ki));
  PetscCall(PetscFree2(sub->kj, sub->ka));
  PetscCall(PetscMalloc1(width + 1, &sub->ki));
  PetscCall(PetscMalloc2(width * width, &sub->kj, width * width, &sub->ka));
  for (PetscInt i = 0; i <= width; i++) sub->ki[i] = width * i;
  for (PetscInt k = 0; k < width * width; k++) sub->kj[k] = k % width;
  PetscCall(PetscArraycpy(sub->ka, S, width * width));
  PetscFunctionReturn(0);
}

/* What this rank does by itself */
static PetscErrorCode LatinInteriorEliminate_Private(LatinSubdomains *sub, LatinInterior *eliminated, PetscInt at[], PetscBool *done)
{
  const LatinSparse whole = {.rows = sub->copies, .i = sub->ki, .j = sub->kj, .a = sub->ka};
  LatinInterior     interior;
  PetscInt          n = 0, width, *kept;
  PetscReal        *S;
  PetscBool        *jumps, bad = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(LatinInteriorNumber_Private(sub, at, &n, done));
  if (!*done) PetscFunctionReturn(0);
  width = sub->copies - n;
  PetscCall(PetscNew(&interior));
  interior->n = n;
  PetscCall(LatinInteriorRows_Private(sub, at, interior));
  PetscCall(PetscMalloc2(width * width, &S, width, &kept));
  for (PetscInt i = 0; i < sub->copies; i++)
    if (at[i] < 0) kept[-1 - at[i]] = i;
  PetscCall(LatinInteriorFactor_Private(sub, interior, done));
  if (*done) PetscCall(LatinEliminate_Private(&whole, width, kept, S, &bad));
  *done = (PetscBool)(*done && !bad);
  if (*done) {
    PetscCall(PetscMalloc1(sub->copies, &jumps));
    PetscCall(LatinJumpsCopies_Private(sub, jumps));
    for (PetscInt k = 0; k < width; k++) jumps[k] = jumps[kept[k]];
    sub->jumps  = jumps;
    *eliminated = interior;
    PetscCall(LatinInteriorShrink_Private(sub, at, width, S));
  } else PetscCall(LatinInteriorReset(&interior));
  PetscCall(PetscFree2(S, kept));
  PetscFunctionReturn(0);
}

/* Eliminates the inside of the subdomain here, where that pays and no option asks for other solvers. Collective on sub->object */
PetscErrorCode LatinInteriorSetUp(LatinSubdomains *sub, LatinInterior *interior)
{
  MPI_Comm    comm = PetscObjectComm(sub->object);
  PetscBool   done = PETSC_FALSE, any, is, local, inside;
  PetscInt   *at;
  PetscLayout map;

  PetscFunctionBegin;
  PetscCall(LatinSolverChosen_Private(PETSC_COMM_SELF, sub->object, "local", MATSOLVERCHOLMOD, &is, &is, &is, &local));
  PetscCall(LatinSolverChosen_Private(PETSC_COMM_SELF, sub->object, "interior", MATSOLVERCHOLMOD, &is, &is, &is, &inside));
  if (local || inside) PetscFunctionReturn(0);
  PetscCall(PetscLogEventBegin(LATIN_Condense, sub->object, 0, 0, 0));
  PetscCall(PetscMalloc1(sub->copies, &at));
  LatinEach(comm, LatinInteriorEliminate_Private(sub, interior, at, &done));
  PetscCall(PetscFree(at));
  PetscCall(MPIU_Allreduce(&done, &any, 1, LATIN_MPI_BOOL, MPI_LOR, comm));
  if (any) { /* the way from the matrix's vectors to the copies that are left */
    PetscCall(PetscSFDestroy(&sub->node_sf));
    PetscCall(PetscSFDestroy(&sub->dof_sf));
    PetscCall(MatGetLayouts(sub->matrix, &map, NULL));
    PetscCall(PetscSFCreate(comm, &sub->node_sf));
    PetscCall(PetscSFSetGraphLayout(sub->node_sf, map, sub->copies, NULL, PETSC_COPY_VALUES, sub->node));
    PetscCall(PetscObjectReference((PetscObject)sub->node_sf));
    sub->dof_sf = sub->node_sf;
  }
  PetscCall(PetscLogEventEnd(LATIN_Condense, sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* What the forces inside do to the interfaces while these are held: f = K_GI y, K_II y = forces */
PetscErrorCode LatinInteriorForces(LatinInterior interior, const LatinSubdomains *sub, Vec forces, PetscReal f[], PetscBool *failed)
{
  const PetscScalar *a;
  PetscScalar       *b;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(forces, &a));
  PetscCall(VecGetArrayWrite(interior->b, &b));
  for (PetscInt i = 0; i < interior->n; i++) b[i] = a[interior->row[i]];
  PetscCall(VecRestoreArrayWrite(interior->b, &b));
  PetscCall(VecRestoreArrayRead(forces, &a));
  PetscCall(KSPSolve(interior->ksp, interior->b, interior->x));
  PetscCall(LatinSolverNote_Private(interior->ksp, PETSC_TRUE, failed));
  PetscCall(PetscArrayzero(f, sub->copies));
  PetscCall(VecGetArrayRead(interior->x, &a));
  for (PetscInt i = 0; i < interior->n; i++) {
    interior->y[i] = a[i];
    for (PetscInt k = interior->ci[i]; k < interior->ci[i + 1]; k++) f[interior->cj[k]] += interior->ca[k] * a[i];
  }
  PetscCall(VecRestoreArrayRead(interior->x, &a));
  PetscFunctionReturn(0);
}

/* u inside, for the forces of before and the displacements v of the interfaces: y - K_II^-1 K_IG v */
PetscErrorCode LatinInteriorExtend(LatinInterior interior, const PetscReal v[], Vec u, PetscBool *failed)
{
  const PetscScalar *x;
  PetscScalar       *b;

  PetscFunctionBegin;
  PetscCall(VecGetArrayWrite(interior->b, &b));
  for (PetscInt i = 0; i < interior->n; i++) {
    b[i] = 0.0;
    for (PetscInt k = interior->ci[i]; k < interior->ci[i + 1]; k++) b[i] += interior->ca[k] * v[interior->cj[k]];
  }
  PetscCall(VecRestoreArrayWrite(interior->b, &b));
  PetscCall(KSPSolve(interior->ksp, interior->b, interior->x));
  PetscCall(LatinSolverNote_Private(interior->ksp, PETSC_TRUE, failed));
  PetscCall(VecGetArrayRead(interior->x, &x));
  PetscCall(VecGetArray(u, &b));
  for (PetscInt i = 0; i < interior->n; i++) b[interior->row[i]] = interior->y[i] - x[i];
  PetscCall(VecRestoreArray(u, &b));
  PetscCall(VecRestoreArrayRead(interior->x, &x));
  PetscFunctionReturn(0);
}
