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
  IS  rows; /* unknowns inside */
  Mat K_II, K_IG;
  KSP ksp;
  Vec b, x, y; /* y: what the forces inside move, interfaces held */
  Vec others;  /* of the copies on interfaces, for arrays of others */
};

PetscErrorCode LatinInteriorReset(LatinInterior *interior)
{
  PetscFunctionBegin;
  if (!*interior) PetscFunctionReturn(0);
  PetscCall(KSPDestroy(&(*interior)->ksp));
  PetscCall(MatDestroy(&(*interior)->K_II));
  PetscCall(MatDestroy(&(*interior)->K_IG));
  PetscCall(VecDestroy(&(*interior)->b));
  PetscCall(VecDestroy(&(*interior)->x));
  PetscCall(VecDestroy(&(*interior)->y));
  PetscCall(VecDestroy(&(*interior)->others));
  PetscCall(ISDestroy(&(*interior)->rows));
  PetscCall(PetscFree(*interior));
  PetscFunctionReturn(0);
}

/* The copies inside, and the others. Does it pay here? */
static PetscErrorCode LatinInteriorNumber_Private(const LatinSubdomains *sub, PetscInt *inside, PetscInt in[], PetscInt *width, PetscInt kept[], PetscBool *pays)
{
  PetscInt    first;
  PetscLayout map;

  PetscFunctionBegin;
  *pays   = PETSC_FALSE;
  *inside = *width = 0;
  if (sub->n != 1) PetscFunctionReturn(0);
  PetscCall(MatGetLayouts(sub->matrix, &map, NULL));
  PetscCall(PetscLayoutGetRange(map, &first, NULL));
  for (PetscInt i = 0; i < sub->copies; i++) {
    if (sub->multiplicity[i] > 1) {
      kept[(*width)++] = i;
      continue;
    }
    if (sub->node[i] < first || sub->node[i] >= first + sub->nodes_local) PetscFunctionReturn(0); /* another rank has it in its part of a vector */
    in[(*inside)++] = i;
  }
  *pays = (PetscBool)(*inside && *width && *width <= LATIN_INTERIOR_WIDTH && *width * *inside <= LATIN_INTERIOR_WORK);
  PetscFunctionReturn(0);
}

/* K_II and K_IG of the matrix K by rows */
static PetscErrorCode LatinInteriorMatrices_Private(const LatinSparse *K, PetscInt inside, const PetscInt in[], PetscInt width, const PetscInt kept[], LatinInterior interior)
{
  Mat whole;
  IS  is[2];

  PetscFunctionBegin;
  PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, K->rows, K->rows, K->i, K->j, K->a, &whole));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, inside, in, PETSC_USE_POINTER, &is[0]));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, width, kept, PETSC_USE_POINTER, &is[1]));
  PetscCall(MatCreateSubMatrix(whole, is[0], is[0], MAT_INITIAL_MATRIX, &interior->K_II));
  PetscCall(MatCreateSubMatrix(whole, is[0], is[1], MAT_INITIAL_MATRIX, &interior->K_IG));
  for (PetscInt k = 0; k < 2; k++) PetscCall(ISDestroy(&is[k]));
  PetscCall(MatDestroy(&whole));
  PetscCall(MatSetOption(interior->K_II, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(interior->K_II, MAT_SPD, PETSC_TRUE));
  PetscCall(MatCreateVecs(interior->K_II, &interior->x, &interior->b));
  PetscCall(VecDuplicate(interior->x, &interior->y));
  PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, width, NULL, &interior->others));
  PetscFunctionReturn(0);
}

/* Factors K_II; *done: by a factorisation, and nothing inside moves by itself, which the stages to come would report with names */
static PetscErrorCode LatinInteriorFactor_Private(const LatinSubdomains *sub, LatinInterior interior, PetscBool *done)
{
  LatinFactorStatus status = {.ierr = (PetscErrorCode)0};
  PC                pc;

  PetscFunctionBegin;
  PetscCall(LatinSolverCreate_Private(PETSC_COMM_SELF, sub->object, "interior", &interior->ksp));
  PetscCall(KSPGetPC(interior->ksp, &pc));
  PetscCall(LatinDirectSolver_Private(pc, interior->K_II, MATSOLVERCHOLMOD));
  PetscCall(KSPSetOperators(interior->ksp, interior->K_II, interior->K_II));
  PetscCall(KSPSetFromOptions(interior->ksp));
  PetscCall(LatinFactor_Private(interior->ksp, interior->K_II, MATSOLVERCHOLMOD, &status));
  PetscCall(VecDestroy(&status.mode));
  *done = (PetscBool)!LatinFactorFailed(&status);
  PetscFunctionReturn(0);
}

/* The copies kept[] take the places of all, and S that of their operator */
static PetscErrorCode LatinInteriorShrink_Private(LatinSubdomains *sub, PetscInt width, const PetscInt kept[], const PetscReal S[])
{
  const PetscInt copies = sub->copies, dim = sub->dim;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < width; k++) {
    const PetscInt i = kept[k];

    sub->node[k]         = sub->node[i];
    sub->field[k]        = sub->field[i];
    sub->fixed[k]        = sub->fixed[i];
    sub->prescribed[k]   = sub->prescribed[i];
    sub->multiplicity[k] = sub->multiplicity[i];
    sub->global_dof[k]   = sub->global_dof[i];
    for (PetscInt d = 0; d < dim; d++) sub->x[dim * k + d] = sub->x[dim * i + d];
  }
  for (PetscInt v = 0; v < sub->nears; v++)
    for (PetscInt k = 0; k < width; k++) sub->near[width * v + k] = sub->near[copies * v + kept[k]];
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
static PetscErrorCode LatinInteriorEliminate_Private(LatinSubdomains *sub, LatinInterior *eliminated, PetscBool *done)
{
  const LatinSparse whole = {.rows = sub->copies, .i = sub->ki, .j = sub->kj, .a = sub->ka};
  LatinInterior     interior;
  PetscInt          inside, width, *in, *kept, *row;
  PetscReal        *S;
  PetscBool        *jumps, bad = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(sub->copies, &in, sub->copies, &kept));
  PetscCall(LatinInteriorNumber_Private(sub, &inside, in, &width, kept, done));
  if (*done) {
    PetscCall(PetscNew(&interior));
    PetscCall(PetscMalloc1(width * width, &S));
    PetscCall(PetscMalloc1(inside, &row));
    for (PetscInt k = 0; k < inside; k++) row[k] = sub->node[in[k]];
    PetscCall(ISCreateGeneral(PETSC_COMM_SELF, inside, row, PETSC_OWN_POINTER, &interior->rows));
    PetscCall(LatinInteriorMatrices_Private(&whole, inside, in, width, kept, interior));
    PetscCall(LatinInteriorFactor_Private(sub, interior, done));
    if (*done) PetscCall(LatinEliminate_Private(&whole, width, kept, S, &bad));
    *done = (PetscBool)(*done && !bad);
    if (*done) {
      PetscCall(PetscMalloc1(sub->copies, &jumps));
      PetscCall(LatinJumpsCopies_Private(sub, jumps));
      for (PetscInt k = 0; k < width; k++) jumps[k] = jumps[kept[k]];
      sub->jumps  = jumps;
      *eliminated = interior;
      PetscCall(LatinInteriorShrink_Private(sub, width, kept, S));
    } else PetscCall(LatinInteriorReset(&interior));
    PetscCall(PetscFree(S));
  }
  PetscCall(PetscFree2(in, kept));
  PetscFunctionReturn(0);
}

/* Eliminates the inside of the subdomain here, where that pays and no option asks for other solvers. Collective on sub->object */
PetscErrorCode LatinInteriorSetUp(LatinSubdomains *sub, LatinInterior *interior)
{
  MPI_Comm    comm = PetscObjectComm(sub->object);
  PetscBool   done = PETSC_FALSE, any, is, local, inside;
  PetscLayout map;

  PetscFunctionBegin;
  PetscCall(LatinSolverChosen_Private(PETSC_COMM_SELF, sub->object, "local", MATSOLVERCHOLMOD, &is, &is, &local));
  PetscCall(LatinSolverChosen_Private(PETSC_COMM_SELF, sub->object, "interior", MATSOLVERCHOLMOD, &is, &is, &inside));
  if (local || inside) PetscFunctionReturn(0);
  PetscCall(PetscLogEventBegin(LATIN_Condense, sub->object, 0, 0, 0));
  LatinEach(comm, LatinInteriorEliminate_Private(sub, interior, &done));
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
PetscErrorCode LatinInteriorForces(LatinInterior interior, Vec forces, PetscReal f[], PetscBool *failed)
{
  PetscFunctionBegin;
  PetscCall(VecISCopy(forces, interior->rows, SCATTER_REVERSE, interior->b));
  PetscCall(KSPSolve(interior->ksp, interior->b, interior->y));
  PetscCall(LatinSolverNote_Private(interior->ksp, PETSC_TRUE, failed));
  PetscCall(VecPlaceArray(interior->others, f));
  PetscCall(MatMultTranspose(interior->K_IG, interior->y, interior->others));
  PetscCall(VecResetArray(interior->others));
  PetscFunctionReturn(0);
}

/* u inside, for the forces of before and the displacements v of the interfaces: y - K_II^-1 K_IG v */
PetscErrorCode LatinInteriorExtend(LatinInterior interior, const PetscReal v[], Vec u, PetscBool *failed)
{
  PetscFunctionBegin;
  PetscCall(VecPlaceArray(interior->others, v));
  PetscCall(MatMult(interior->K_IG, interior->others, interior->b));
  PetscCall(VecResetArray(interior->others));
  PetscCall(KSPSolve(interior->ksp, interior->b, interior->x));
  PetscCall(LatinSolverNote_Private(interior->ksp, PETSC_TRUE, failed));
  PetscCall(VecAYPX(interior->x, -1.0, interior->y));
  PetscCall(VecISCopy(u, interior->rows, SCATTER_FORWARD, interior->x));
  PetscFunctionReturn(0);
}
