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

/* A row of an element's operator as a record: row, length, columns, values; returns how long that is. record may be NULL */
static PetscInt LatinCoarseRecord(const LatinCoarse *coarse, PetscInt s, PetscInt i, PetscBool half, const PetscInt by[], PetscScalar record[])
{
  const LatinElements *top = &coarse->top;
  const PetscInt       m = top->offset[s + 1] - top->offset[s], first = half ? i : 0, n = m - first, *row = coarse->top_global + top->offset[s];
  const PetscReal     *H = top->H + top->h_offset[s];

  if (!record) return 2 + 2 * n;
  record[0] = row[by[i]];
  record[1] = n;
  for (PetscInt j = 0; j < n; j++) {
    record[2 + j]     = row[by[first + j]];
    record[2 + n + j] = H[by[first + j] + m * by[i]]; /* symmetric to the bit */
  }
  return 2 + 2 * n;
}

static PetscErrorCode LatinCoarseAdd_Private(Mat A, const PetscScalar record[], PetscInt column[], PetscInt *length)
{
  const PetscInt row = (PetscInt)PetscRealPart(record[0]), n = (PetscInt)PetscRealPart(record[1]);

  PetscFunctionBegin;
  for (PetscInt j = 0; j < n; j++) column[j] = (PetscInt)PetscRealPart(record[2 + j]);
  PetscCall(MatSetValues(A, 1, &row, n, column, record + 2 + n, ADD_VALUES));
  *length = 2 + 2 * n;
  PetscFunctionReturn(0);
}

/*
   Adds the elements' operators to A: rows of this rank, then those that other ranks send, in the order of the ranks.
   PETSc's own assembly adds what arrives first, so that sums of three and more are not the same bits twice.
*/
static PetscErrorCode LatinCoarseFill_Private(Latin latin, PetscBool half, const PetscInt order[], PetscInt widest)
{
  LatinCoarse         *coarse = &latin->coarse;
  const LatinElements *top    = &coarse->top;
  MPI_Comm             comm   = PetscObjectComm((PetscObject)latin);
  PetscMPIInt          rank, size, owner, *sends, *receives, *from, *to;
  PetscScalar         *out, *in, *record;
  PetscInt            *column, *next, length;
  PetscLayout          map;

  PetscFunctionBegin;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &widest, 1, MPIU_INT, MPI_MAX, comm));
  PetscCall(MatGetLayouts(coarse->A, &map, NULL));
  PetscCall(PetscCalloc5(size, &next, size, &sends, size, &receives, size + 1, &from, size + 1, &to));
  PetscCall(PetscMalloc2(widest, &column, 2 + 2 * widest, &record));
  for (PetscInt s = 0; s < top->n && size > 1; s++) {
    for (PetscInt i = 0; i < top->offset[s + 1] - top->offset[s]; i++) {
      const PetscInt *by = order + top->offset[s];

      PetscCall(PetscLayoutFindOwner(map, coarse->top_global[top->offset[s] + by[i]], &owner));
      if (owner != rank) next[owner] += LatinCoarseRecord(coarse, s, i, half, by, NULL);
    }
  }
  for (PetscMPIInt r = 0; r < size; r++) PetscCall(PetscMPIIntCast(next[r], &sends[r]));
  PetscCallMPI(MPI_Alltoall(sends, 1, MPI_INT, receives, 1, MPI_INT, comm));
  for (PetscMPIInt r = 0; r < size; r++) {
    next[r] = to[r];
    PetscCall(PetscMPIIntCast((PetscInt)to[r] + sends[r], &to[r + 1]));
    PetscCall(PetscMPIIntCast((PetscInt)from[r] + receives[r], &from[r + 1]));
  }
  PetscCall(PetscMalloc2(to[size], &out, from[size], &in));
  for (PetscInt s = 0; s < top->n; s++) {
    for (PetscInt i = 0; i < top->offset[s + 1] - top->offset[s]; i++) {
      const PetscInt *by = order + top->offset[s];

      PetscCall(PetscLayoutFindOwner(map, coarse->top_global[top->offset[s] + by[i]], &owner));
      if (owner != rank) {
        next[owner] += LatinCoarseRecord(coarse, s, i, half, by, out + next[owner]);
        continue;
      }
      (void)LatinCoarseRecord(coarse, s, i, half, by, record);
      PetscCall(LatinCoarseAdd_Private(coarse->A, record, column, &length));
    }
  }
  PetscCallMPI(MPI_Alltoallv(out, sends, to, MPIU_SCALAR, in, receives, from, MPIU_SCALAR, comm));
  for (PetscMPIInt k = 0; k < from[size]; k += (PetscMPIInt)length) PetscCall(LatinCoarseAdd_Private(coarse->A, in + k, column, &length));
  PetscCall(PetscFree2(out, in));
  PetscCall(PetscFree2(column, record));
  PetscCall(PetscFree5(next, sends, receives, from, to));
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
  PetscInt            *width, *bound, *outside, *order, widest = 0;

  PetscFunctionBegin;
  for (PetscInt s = 0; s < top->n; s++) widest = PetscMax(widest, top->offset[s + 1] - top->offset[s]);
  PetscCall(PetscMalloc4(top->offset[top->n], &width, top->offset[top->n], &order, n, &bound, n, &outside));
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
  PetscCall(MatSetOption(coarse->A, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  PetscCall(LatinCoarseFill_Private(latin, half, order, widest));
  PetscCall(PetscFree4(width, order, bound, outside));
  PetscCall(MatAssemblyBegin(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(coarse->A, MAT_FINAL_ASSEMBLY));
  PetscCall(MatSetOption(coarse->A, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(coarse->A, MAT_SPD, PETSC_TRUE));
  PetscFunctionReturn(0);
}

/* What the coarse solver that the options choose can use */
typedef enum { SOLVER_DIRECT, SOLVER_ITERATIVE, SOLVER_SUBASSEMBLED, SOLVER_LATIN } LatinCoarseSolver;

/*
   Groups that repeat are condensed for direct solvers, for they fill the matrix, and are the subdomains of a solver of
   type latin; BDDC and FETI-DP want the part of each rank by itself; half of a symmetric matrix is for Cholesky alone.
*/
static PetscErrorCode LatinCoarseChoose_Private(Latin latin, LatinCoarseSolver *solver, PetscBool *half)
{
  const char *prefix, *options[] = {"-coarse_pc_type", "-coarse_ksp_type"};
  char        value[64];
  PetscBool   set;
  Mat         A;

  PetscFunctionBegin;
  *half   = PETSC_TRUE;
  *solver = SOLVER_DIRECT;
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(PetscOptionsGetString(((PetscObject)latin)->options, prefix, options[i], value, sizeof(value), &set));
    if (!set || !strcmp(value, PCCHOLESKY) || !strcmp(value, KSPPREONLY)) continue;
    *half = PETSC_FALSE;
    if (!i && !strcmp(value, PCLATIN)) *solver = SOLVER_LATIN;
    else if (!strcmp(value, PCBDDC) || !strcmp(value, KSPFETIDP)) *solver = SOLVER_SUBASSEMBLED;
    else if (strcmp(value, PCLU) && strcmp(value, PCREDUNDANT) && *solver == SOLVER_DIRECT) *solver = SOLVER_ITERATIVE;
  }
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

/* Where every rank solves the whole, which gives the same bits twice, it is by the factorisation of one rank. Collective on ksp */
static PetscErrorCode LatinCoarseRedundant_Private(KSP ksp)
{
  PetscBool redundant;
  PC        pc, whole;
  KSP       inner;
  Mat       A;

  PetscFunctionBegin;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCREDUNDANT, &redundant));
  if (!redundant) PetscFunctionReturn(0);
  PetscCall(PCRedundantGetKSP(pc, &inner));
  PetscCall(KSPGetPC(inner, &whole));
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, 1, 1, 1, NULL, &A));
  PetscCall(LatinDirectSolver_Private(whole, A, MATSOLVERMUMPS));
  PetscCall(MatDestroy(&A));
  PetscCall(KSPSetFromOptions(inner));
  PetscFunctionReturn(0);
}

/* The solver: a factorisation, if the options choose nothing else */
static PetscErrorCode LatinCoarseSolver_Private(Latin latin, LatinCoarseSolver solver, MatSolverType preferred)
{
  LatinCoarse         *coarse = &latin->coarse;
  const LatinUnknowns *known  = &coarse->above.known;
  const char          *prefix;
  PetscBool            direct, bddc;
  PC                   pc;

  PetscFunctionBegin;
  PetscCall(KSPCreate(PetscObjectComm((PetscObject)coarse->A), &coarse->ksp));
  PetscCall(PetscObjectIncrementTabLevel((PetscObject)coarse->ksp, (PetscObject)latin, 1));
  PetscCall(PetscObjectSetOptions((PetscObject)coarse->ksp, ((PetscObject)latin)->options));
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)latin, &prefix));
  PetscCall(KSPSetOptionsPrefix(coarse->ksp, prefix));
  PetscCall(KSPAppendOptionsPrefix(coarse->ksp, "coarse_"));
  PetscCall(KSPSetType(coarse->ksp, KSPPREONLY));
  PetscCall(KSPGetPC(coarse->ksp, &pc));
  if (solver != SOLVER_SUBASSEMBLED) PetscCall(LatinDirectSolver_Private(pc, coarse->A, preferred));
  PetscCall(KSPSetOperators(coarse->ksp, coarse->A, coarse->A));
  PetscCall(KSPSetFromOptions(coarse->ksp));
  PetscCall(LatinCoarseRedundant_Private(coarse->ksp));
  PetscCall(LatinSolverDefaults_Private(latin, coarse->ksp, "coarse", &direct));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCBDDC, &bddc)); /* multigrid would forget the near null space */
  if (bddc && known->dim) PetscCall(PCSetCoordinates(pc, known->dim, coarse->top_local, known->x));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCoarseSetUp(Latin latin)
{
  LatinCoarse      *coarse    = &latin->coarse;
  LatinFactorStatus status    = {0, PC_NOERROR, PETSC_FALSE};
  LatinCoarseSolver solver    = SOLVER_DIRECT;
  MatSolverType     preferred = MATSOLVERMUMPS;
  Vec               soft      = NULL;
  PetscInt          rows;
  PetscBool         half = PETSC_FALSE, whole = PETSC_FALSE;

  PetscFunctionBegin;
  if (!coarse->macro_global && !coarse->primal_global) PetscFunctionReturn(0); /* no interface: one subdomain, or disconnected ones */
  PetscCall(PetscLogEventBegin(LATIN_Coarse, latin, 0, 0, 0));
  PetscCall(LatinCoarseChoose_Private(latin, &solver, &half));
  PetscCall(LatinNestSetUp(latin, solver == SOLVER_DIRECT || solver == SOLVER_LATIN ? latin->coarse_groups : 1, (PetscBool)(solver != SOLVER_LATIN)));
  if (solver == SOLVER_DIRECT) PetscCall(LatinWholeWanted_Private(latin, &whole));
  if (solver == SOLVER_SUBASSEMBLED) PetscCall(LatinLevelSubassemble_Private(latin, &coarse->A));
  else if (whole) PetscCall(LatinWholeAssemble_Private(latin));
  else PetscCall(LatinCoarseAssemble_Private(latin, half));
  if (solver != SOLVER_DIRECT) PetscCall(LatinLevelSetUp_Private(latin, coarse->A));
  if (solver == SOLVER_LATIN) PetscCall(LatinLevelElements_Private(latin, coarse->A));
  PetscCall(LatinNestFinish(latin));
  PetscCall(MatCreateVecs(coarse->A, &coarse->sol, &coarse->rhs));
  if (whole) preferred = LatinWholePackage(latin);
  PetscCall(LatinCoarseSolver_Private(latin, solver, preferred));
  PetscCall(MatGetSize(coarse->A, &rows, NULL));
  if (rows) { /* disconnected structures may be condensed entirely, each a group */
    PetscCall(LatinFactor_Private(coarse->ksp, coarse->A, preferred, &status, &soft));
    PetscCall(LatinFactorAgree_Private(latin, &status, soft, NULL, "coarse"));
    if (solver != SOLVER_DIRECT && latin->preconditions) PetscCall(LatinSolverTest_Private(coarse->ksp, coarse->A, &latin->inexact));
  }
  PetscCall(PetscLogEventEnd(LATIN_Coarse, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* The displacements of the elements here, of a vector of the coarse problem */
static PetscErrorCode LatinCoarseDistribute_Private(Latin latin, Vec v)
{
  LatinCoarse       *coarse = &latin->coarse;
  const PetscScalar *x;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(v, &x));
  if (coarse->whole) {
    for (PetscInt i = 0; i < coarse->top.offset[coarse->top.n]; i++) coarse->top.u[i] = x[coarse->top_global[i]];
  } else PetscCall(LatinSFBcast_Private(coarse->top_sf, 1, MPIU_SCALAR, x, coarse->top.u));
  PetscCall(VecRestoreArrayRead(v, &x));
  PetscFunctionReturn(0);
}

/* From the condensed forces q of the subdomains to the coarse displacements u */
PetscErrorCode LatinCoarseSolve(Latin latin)
{
  LatinCoarse *coarse = &latin->coarse;
  PetscScalar *b;
  PetscInt     rows;

  PetscFunctionBegin;
  if (!coarse->A) PetscFunctionReturn(0);
  PetscCall(PetscLogEventBegin(LATIN_Coarse, latin, 0, 0, 0));
  PetscCall(LatinNestDown(latin));
  PetscCall(VecZeroEntries(coarse->rhs));
  PetscCall(VecGetArray(coarse->rhs, &b));
  if (coarse->whole) PetscCall(LatinWholeForces_Private(latin, b));
  else PetscCall(LatinSFReduce_Private(coarse->top_sf, 1, MPIU_SCALAR, coarse->top.q, b, MPI_SUM));
  PetscCall(VecRestoreArray(coarse->rhs, &b));
  PetscCall(VecGetSize(coarse->rhs, &rows));
  if (rows) {
    PetscCall(KSPSolve(coarse->ksp, coarse->rhs, coarse->sol));
    PetscCall(LatinSolverNote_Private(latin, coarse->ksp));
  }
  PetscCall(LatinCoarseDistribute_Private(latin, coarse->sol));
  PetscCall(LatinNestUp(latin));
  PetscCall(PetscLogEventEnd(LATIN_Coarse, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* The coarse displacements u of the subdomains for a vector of the coarse problem, without any other force */
PetscErrorCode LatinCoarseExpand_Private(Latin latin, Vec v)
{
  PetscFunctionBegin;
  PetscCall(PetscArrayzero(latin->coarse.q, latin->coarse.offset[latin->sub.n]));
  PetscCall(LatinNestDown(latin));
  PetscCall(LatinCoarseDistribute_Private(latin, v));
  PetscCall(LatinNestUp(latin));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCoarseReset(Latin latin)
{
  LatinCoarse *coarse = &latin->coarse;

  PetscFunctionBegin;
  PetscCall(LatinNestReset(latin));
  PetscCall(KSPDestroy(&coarse->ksp));
  PetscCall(LatinLevelReset_Private(&coarse->above, coarse->A));
  PetscCall(MatDestroy(&coarse->A));
  PetscCall(LatinWholeReset(latin));
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
