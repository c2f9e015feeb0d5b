#include "latinimpl.h"

/*
   The coarse problem (30), (52): continuity of the macro displacements and of the primal nodes, balance of the
   corresponding forces. Its unknowns are numbered by the rank that builds a macro basis, or that has the lowest
   subdomain of a primal component.
*/

/* Numbers of the primal displacements: the lowest subdomain of a component gives them, the exchange table carries them */
static PetscErrorCode LatinCoarseNumberPrimal_Private(Latin latin, PetscInt table[])
{
  LatinSubstructure *sub   = &latin->sub;
  LatinInterfaces   *inter = &latin->inter;
  const PetscInt     bs    = latin->sub.bs;

  PetscFunctionBegin;
  latin->coarse.primal_local = 0;
  for (PetscInt i = 0; i < sub->copies; i++) {
    const PetscInt p = inter->position[i], m = inter->share_offset[i + 1] - inter->share_offset[i];

    if (inter->component[i] < 0 || inter->component[i] != p) continue;
    table[inter->table_offset[i] + p * m + p] = 1 + latin->coarse.primal_local;
    for (PetscInt c = 0; c < bs; c++) latin->coarse.primal_local += sub->fixed[bs * i + c] ? 0 : 1;
  }
  PetscCall(LatinInterfaceExchange_Private(latin, table));
  PetscFunctionReturn(0);
}

/* The coarse dofs of each subdomain here and their global numbers */
PetscErrorCode LatinCoarseNumber(Latin latin)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinInterfaces   *inter  = &latin->inter;
  LatinLinear       *linear = &latin->linear;
  LatinCoarse       *coarse = &latin->coarse;
  MPI_Comm           comm   = PetscObjectComm((PetscObject)latin);
  const PetscInt     bs     = latin->sub.bs;
  PetscInt          *table, count = 0, primal = 0, mine[2];
  PetscMPIInt        size;
  PetscLayout        map;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscCalloc1(inter->table_offset[sub->copies], &table));
  PetscCall(LatinCoarseNumberPrimal_Private(latin, table));
  PetscCall(PetscMalloc1(size + 1, &coarse->rank_start));
  mine[0] = coarse->macro_local + coarse->primal_local;
  PetscCallMPI(MPI_Allgather(mine, 1, MPIU_INT, coarse->rank_start + 1, 1, MPIU_INT, comm));
  coarse->rank_start[0] = 0;
  for (PetscMPIInt r = 0; r < size; r++) coarse->rank_start[r + 1] += coarse->rank_start[r];
  coarse->primal_global = coarse->rank_start[size] - coarse->macro_global;
  /* primal numbers follow the macro ones of the same rank: every rank must know how many those are */
  {
    PetscInt *macros;

    PetscCall(PetscMalloc1(size, &macros));
    PetscCallMPI(MPI_Allgather(&coarse->macro_local, 1, MPIU_INT, macros, 1, MPIU_INT, comm));

    PetscCall(PetscMalloc1(sub->n + 1, &linear->primal_offset));
    PetscCall(PetscMalloc1(bs * sub->copies, &linear->primal_index));
    PetscCall(PetscMalloc1(sub->n + 1, &coarse->offset));
    PetscCall(PetscMalloc1(sub->n, &coarse->macro_count));
    for (PetscInt i = 0; i < bs * sub->copies; i++) {
      linear->primal_index[i] = inter->component[i / bs] >= 0 && !sub->fixed[i] ? 0 : -1;
      if (!linear->primal_index[i]) primal++;
    }
    for (PetscInt f = 0; f < inter->count; f++) count += inter->interface[f].modes;
    PetscCall(PetscMalloc1(primal, &linear->primal_dof));
    PetscCall(PetscMalloc3(count + primal, &coarse->global, count + primal, &coarse->q, count + primal, &coarse->u));
    count          = 0;
    primal         = 0;
    linear->widest = 0;
    for (PetscInt s = 0; s < sub->n; s++) {
      coarse->offset[s]        = count;
      linear->primal_offset[s] = primal;
      for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
        LatinInterface   *face  = &inter->interface[f];
        const PetscMPIInt owner = LatinSubdomainRank(sub, size, PetscMin(sub->first + s, face->neighbour));

        face->local_first = count;
        for (PetscInt k = 0; k < face->modes; k++) coarse->global[count++] = coarse->rank_start[owner] + face->coarse_first + k;
      }
      coarse->macro_count[s] = count - coarse->offset[s];
      for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++) {
        const PetscInt m = inter->share_offset[i + 1] - inter->share_offset[i], leader = inter->component[i];
        PetscInt       next;
        PetscMPIInt    owner;

        if (leader < 0) continue;
        owner = LatinSubdomainRank(sub, size, inter->share_list[inter->share_offset[i] + leader]);
        next  = coarse->rank_start[owner] + macros[owner] + table[inter->table_offset[i] + leader * m + leader] - 1;
        for (PetscInt c = 0; c < bs; c++) {
          if (sub->fixed[bs * i + c]) continue;
          linear->primal_index[bs * i + c] = primal - linear->primal_offset[s];
          linear->primal_dof[primal++]     = bs * i + c;
          coarse->global[count++]          = next++;
        }
      }
      linear->widest = PetscMax(linear->widest, count - coarse->offset[s]);
    }
    coarse->offset[sub->n]        = count;
    linear->primal_offset[sub->n] = primal;
    PetscCall(PetscFree(macros));
  }
  PetscCall(PetscFree(table));
  PetscCall(PetscLayoutCreateFromSizes(comm, mine[0], PETSC_DETERMINE, 1, &map));
  PetscCall(PetscSFCreate(comm, &coarse->sf));
  PetscCall(PetscSFSetGraphLayout(coarse->sf, map, count, NULL, PETSC_COPY_VALUES, coarse->global));
  PetscCall(PetscSFSetUp(coarse->sf));
  PetscCall(PetscLayoutDestroy(&map));
  PetscFunctionReturn(0);
}

/*
   Assembles sum_E c_E^t H_E c_E over the elements, of a symmetric matrix (half) the upper part. A row has at most as many
   entries as the elements of its dof have dofs, in half a matrix those of higher numbers. Entries come in the order of
   their columns: each row then grows at its end.
*/
static PetscErrorCode LatinCoarseAssemble_Private(Latin latin, PetscBool half)
{
  LatinCoarse         *coarse = &latin->coarse;
  const LatinElements *top    = &coarse->top;
  MPI_Comm             comm   = PetscObjectComm((PetscObject)latin);
  const PetscInt       n      = coarse->top_local;
  PetscInt            *width, *bound, *outside, *order, *column, widest = 0;
  PetscScalar         *value;

  PetscFunctionBegin;
  for (PetscInt s = 0; s < top->n; s++) widest = PetscMax(widest, top->offset[s + 1] - top->offset[s]);
  PetscCall(PetscMalloc6(top->offset[top->n], &width, top->offset[top->n], &order, n, &bound, n, &outside, widest, &column, widest, &value));
  PetscCall(PetscArrayzero(bound, n));
  for (PetscInt s = 0; s < top->n; s++) {
    const PetscInt m = top->offset[s + 1] - top->offset[s], *row = coarse->top_global + top->offset[s];
    PetscInt      *by = order + top->offset[s];

    for (PetscInt i = 0; i < m; i++) by[i] = i;
    PetscCall(PetscSortIntWithPermutation(m, row, by));
    for (PetscInt i = 0; i < m; i++) width[top->offset[s] + by[i]] = half ? m - i : m;
  }
  PetscCall(LatinSFReduce_Private(coarse->top_sf, 1, MPIU_INT, width, bound, MPI_SUM));
  for (PetscInt i = 0; i < n; i++) {
    outside[i] = PetscMin(bound[i], coarse->top_size - n);
    bound[i]   = PetscMin(bound[i], half ? n - i : n);
  }
  PetscCall(MatCreate(comm, &coarse->A));
  PetscCall(MatSetSizes(coarse->A, n, n, coarse->top_size, coarse->top_size));
  PetscCall(MatSetType(coarse->A, half ? MATSBAIJ : MATAIJ));
  PetscCall(MatXAIJSetPreallocation(coarse->A, 1, bound, outside, bound, outside));
  for (PetscInt s = 0; s < top->n; s++) {
    const PetscInt   m = top->offset[s + 1] - top->offset[s], *row = coarse->top_global + top->offset[s], *by = order + top->offset[s];
    const PetscReal *H = top->H + top->h_offset[s];

    for (PetscInt i = 0; i < m; i++) column[i] = row[by[i]];
    for (PetscInt i = 0; i < m; i++) {
      const PetscInt first = half ? i : 0;

      for (PetscInt j = first; j < m; j++) value[j] = H[by[j] + m * by[i]]; /* symmetric to the bit */
      PetscCall(MatSetValues(coarse->A, 1, column + i, m - first, column + first, value + first, ADD_VALUES));
    }
  }
  PetscCall(PetscFree6(width, order, bound, outside, column, value));
  PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/*
   What the coarse solver that the options choose can use: groups, which fill the matrix, are for direct solvers, and
   half of a symmetric matrix for Cholesky alone.
*/
static PetscErrorCode LatinCoarseMatrix_Private(Latin latin, PetscInt *width, PetscBool *half)
{
  const char *prefix, *options[] = {"-coarse_pc_type", "-coarse_ksp_type"};
  char        value[64];
  PetscBool   set, direct = PETSC_TRUE;
  Mat         A;

  PetscFunctionBegin;
  *half = PETSC_TRUE;
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(PetscOptionsGetString(((PetscObject)latin)->options, prefix, options[i], value, sizeof(value), &set));
    if (!set || !strcmp(value, PCCHOLESKY) || !strcmp(value, KSPPREONLY)) continue;
    *half = PETSC_FALSE;
    if (strcmp(value, PCLU) && strcmp(value, PCREDUNDANT)) direct = PETSC_FALSE;
  }
  *width = direct ? latin->coarse_groups : 1;
  if (*half) { /* without a package for it on these ranks, every rank solves the whole */
    PetscCall(MatCreate(PetscObjectComm((PetscObject)latin), &A));
    PetscCall(MatSetSizes(A, 1, 1, PETSC_DETERMINE, PETSC_DETERMINE));
    PetscCall(MatSetType(A, MATSBAIJ));
    PetscCall(MatSetUp(A)); /* later versions of PETSc ask for it */
    PetscCall(LatinDirectSolverAvailable_Private(A, MATSOLVERMUMPS, NULL, half));
    PetscCall(MatDestroy(&A));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCoarseSetUp(Latin latin)
{
  LatinCoarse      *coarse = &latin->coarse;
  MPI_Comm          comm   = PetscObjectComm((PetscObject)latin);
  LatinFactorStatus status = {0, PC_NOERROR, PETSC_FALSE};
  Vec               soft   = NULL;
  const char       *prefix;
  PetscInt          width = 1, rows;
  PetscBool         half  = PETSC_FALSE;
  PC                pc;

  PetscFunctionBegin;
  if (!coarse->macro_global && !coarse->primal_global) PetscFunctionReturn(0); /* no interface: one subdomain, or disconnected ones */
  PetscCall(PetscLogEventBegin(LATIN_Coarse, latin, 0, 0, 0));
  PetscCall(LatinCoarseMatrix_Private(latin, &width, &half));
  PetscCall(LatinNestSetUp(latin, width));
  PetscCall(LatinCoarseAssemble_Private(latin, half));
  PetscCall(LatinNestFinish(latin));
  PetscCall(MatCreateVecs(coarse->A, &coarse->sol, &coarse->rhs));
  if (!coarse->ksp) {
    PetscCall(KSPCreate(comm, &coarse->ksp));
    PetscCall(PetscObjectIncrementTabLevel((PetscObject)coarse->ksp, (PetscObject)latin, 1));
    PetscCall(PetscObjectSetOptions((PetscObject)coarse->ksp, ((PetscObject)latin)->options));
    PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
    PetscCall(KSPSetOptionsPrefix(coarse->ksp, prefix));
    PetscCall(KSPAppendOptionsPrefix(coarse->ksp, "coarse_"));
    PetscCall(KSPSetType(coarse->ksp, KSPPREONLY));
    PetscCall(KSPGetPC(coarse->ksp, &pc));
    PetscCall(LatinDirectSolver_Private(pc, coarse->A, MATSOLVERMUMPS));
    PetscCall(KSPSetOperators(coarse->ksp, coarse->A, coarse->A));
    PetscCall(KSPSetFromOptions(coarse->ksp));
  } else PetscCall(KSPSetOperators(coarse->ksp, coarse->A, coarse->A));
  PetscCall(MatGetSize(coarse->A, &rows, NULL));
  if (rows) { /* disconnected structures may be condensed entirely, each a group */
    PetscCall(LatinFactor_Private(coarse->ksp, coarse->A, MATSOLVERMUMPS, &status, &soft));
    PetscCall(LatinFactorAgree_Private(latin, &status, soft, NULL, "coarse"));
  }
  PetscCall(PetscLogEventEnd(LATIN_Coarse, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* From the condensed forces q of the subdomains to the coarse displacements u */
PetscErrorCode LatinCoarseSolve(Latin latin)
{
  KSPConvergedReason reason;
  LatinCoarse       *coarse = &latin->coarse;
  PetscScalar       *b;
  const PetscScalar *x;
  PetscInt           rows;

  PetscFunctionBegin;
  if (!coarse->A) PetscFunctionReturn(0);
  PetscCall(PetscLogEventBegin(LATIN_Coarse, latin, 0, 0, 0));
  PetscCall(LatinNestDown(latin));
  PetscCall(VecZeroEntries(coarse->rhs));
  PetscCall(VecGetArray(coarse->rhs, &b));
  PetscCall(LatinSFReduce_Private(coarse->top_sf, 1, MPIU_SCALAR, coarse->top.q, b, MPI_SUM));
  PetscCall(VecRestoreArray(coarse->rhs, &b));
  PetscCall(VecGetSize(coarse->rhs, &rows));
  if (rows) {
    PetscCall(KSPSolve(coarse->ksp, coarse->rhs, coarse->sol));
    PetscCall(KSPGetConvergedReason(coarse->ksp, &reason));
    if (reason < 0) latin->failed = PETSC_TRUE;
  }
  PetscCall(VecGetArrayRead(coarse->sol, &x));
  PetscCall(LatinSFBcast_Private(coarse->top_sf, 1, MPIU_SCALAR, x, coarse->top.u));
  PetscCall(VecRestoreArrayRead(coarse->sol, &x));
  PetscCall(LatinNestUp(latin));
  PetscCall(PetscLogEventEnd(LATIN_Coarse, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* The coarse displacements u of the subdomains for a vector of the coarse problem, without any other force */
PetscErrorCode LatinCoarseExpand_Private(Latin latin, Vec v)
{
  LatinCoarse       *coarse = &latin->coarse;
  const PetscScalar *x;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(coarse->q, coarse->offset[latin->sub.n]));
  PetscCall(LatinNestDown(latin));
  PetscCall(VecGetArrayRead(v, &x));
  PetscCall(LatinSFBcast_Private(coarse->top_sf, 1, MPIU_SCALAR, x, coarse->top.u));
  PetscCall(VecRestoreArrayRead(v, &x));
  PetscCall(LatinNestUp(latin));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCoarseReset(Latin latin)
{
  LatinCoarse *coarse = &latin->coarse;

  PetscFunctionBegin;
  PetscCall(LatinNestReset(latin));
  PetscCall(KSPDestroy(&coarse->ksp));
  PetscCall(MatDestroy(&coarse->A));
  PetscCall(VecDestroy(&coarse->rhs));
  PetscCall(VecDestroy(&coarse->sol));
  PetscCall(PetscSFDestroy(&coarse->sf));
  PetscCall(PetscFree(coarse->rank_start));
  PetscCall(PetscFree(coarse->offset));
  PetscCall(PetscFree(coarse->macro_count));
  PetscCall(PetscFree3(coarse->global, coarse->q, coarse->u));
  PetscCall(PetscMemzero(coarse, sizeof(*coarse)));
  PetscFunctionReturn(0);
}
