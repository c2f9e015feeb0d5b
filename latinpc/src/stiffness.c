#include "latinimpl.h"

/*
   What the subdomains oppose to displacements of one of their interfaces, the scale of a good search direction: the
   diagonal of B^t k B; its block on the side dofs of the interface; or its Schur complement there, with everything
   else of the subdomain free.

   A subdomain may float, or have mechanisms of its own, and its Schur complement is then nearly singular where a
   search direction needs springs most. So the matrices are those of B^t k B plus a small part of its diagonal: the
   links on an elastic foundation. Their eigenvalues relative to that diagonal are bounded from below by construction.
*/

#define LATIN_STIFFNESS_FLOOR   0.01                          /* stiffness of the foundation, relative to the diagonal of B^t k B */
#define LATIN_STIFFNESS_DENSE   0.05                          /* the same of a subdomain that has been condensed: only its interfaces rest on it */
#define LATIN_STIFFNESS_LEAST   0.1                           /* least diagonal entry, relative to the mean of the subdomain: for dofs that hardly any link reaches */
#define LATIN_STIFFNESS_TINY    LatinByPrecision(1e-10, 1e-5) /* the same for matrices, whose coefficients may jump: no dof of theirs dangles */
#define LATIN_STIFFNESS_PARTIAL 128                           /* fewest side dofs of a subdomain that pay for a factor of its own */
#define LATIN_STIFFNESS_COLUMNS 16                            /* right-hand sides solved together: bounds the work space to that many copies of U */

/* The foundation of the subdomains. Collective on latin. */
static PetscErrorCode LatinStiffnessFoundation_Private(Latin latin, PetscReal spring[])
{
  LatinSubstructure *sub    = &latin->sub;
  const PetscInt     bs     = latin->sub.bs;
  const PetscReal    floor  = latin->interior ? LATIN_STIFFNESS_DENSE : LATIN_STIFFNESS_FLOOR;
  PetscReal          sum[2] = {0.0, 0.0}, fallback;

  PetscFunctionBegin;
  PetscCall(LatinOperatorDiagonal(latin, spring));
  for (PetscInt i = 0; i < bs * sub->copies; i++)
    if (!sub->fixed[i]) {
      sum[0] += spring[i];
      sum[1] += 1.0;
    }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)latin)));
  fallback = sum[0] > 0.0 ? sum[0] / sum[1] : 1.0;
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt first = bs * sub->node_offset[s], last = bs * sub->node_offset[s + 1];
    PetscReal      mean = 0.0;
    PetscInt       n    = 0;

    for (PetscInt i = first; i < last; i++)
      if (!sub->fixed[i]) {
        mean += spring[i];
        n++;
      }
    mean /= PetscMax(n, 1);
    if (!(mean > 0.0)) mean = fallback; /* all links of the subdomain are slack */
    for (PetscInt i = first; i < last; i++) spring[i] = floor * PetscMax(spring[i], (latin->matrix ? LATIN_STIFFNESS_TINY : LATIN_STIFFNESS_LEAST) * mean);
  }
  PetscFunctionReturn(0);
}

/* The rows at the side dofs of one interface; at[dof] = -1 is work space */
static PetscErrorCode LatinStiffnessBlock_Private(Latin latin, LatinGraph *graph, const LatinInterface *face, const PetscReal spring[], PetscInt at[], PetscReal S[])
{
  LatinInterfaces *inter = &latin->inter;
  const PetscInt   bs = latin->sub.bs, rows = face->side_last - face->side_first;
  PetscInt         n = 0, last = -1;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(S, rows * rows));
  for (PetscInt r = 0; r < rows; r++) at[inter->side_dof[face->side_first + r]] = r;
  for (PetscInt r = 0; r < rows; r++) {
    const PetscInt dof = inter->side_dof[face->side_first + r];

    if (dof / bs != last) PetscCall(LatinGraphRow_Private(latin, graph, dof / bs, spring, &n));
    last = dof / bs;
    for (PetscInt q = 0; q < n; q++)
      for (PetscInt b = 0; b < bs; b++) {
        const PetscInt k = at[bs * graph->neighbour[q] + b];

        if (k >= r) S[r + rows * k] = S[k + rows * r] = graph->block[bs * bs * q + (dof % bs) * bs + b];
      }
  }
  for (PetscInt r = 0; r < rows; r++) at[inter->side_dof[face->side_first + r]] = -1;
  PetscFunctionReturn(0);
}

/* B^t k B and the foundation of the subdomains list[], a block diagonal matrix; row[p] is the first row of each */
static PetscErrorCode LatinStiffnessMatrix_Private(Latin latin, LatinGraph *graph, PetscInt patterns, const PetscInt list[], const PetscInt row[], const PetscReal spring[], PetscInt *ci, PetscInt **cj, PetscReal **ca)
{
  LatinSubstructure *sub = &latin->sub;
  const PetscInt     bs  = latin->sub.bs;

  PetscFunctionBegin;
  for (PetscInt pass = 0; pass < 2; pass++) {
    PetscInt nz = 0, n = 0;

    for (PetscInt p = 0; p < patterns; p++) {
      const PetscInt top = bs * sub->node_offset[list[p]];

      for (PetscInt dof = top; dof < bs * sub->node_offset[list[p] + 1]; dof++) {
        if (dof % bs == 0) PetscCall(LatinGraphRow_Private(latin, graph, dof / bs, spring, &n));
        ci[row[p] + dof - top] = nz;
        for (PetscInt q = 0; q < n; q++)
          for (PetscInt b = 0; b < bs; b++) {
            const PetscInt col = bs * graph->neighbour[q] + b;

            if (col != dof && (sub->fixed[dof] || sub->fixed[col])) continue;
            if (pass) {
              (*cj)[nz] = row[p] + col - top;
              (*ca)[nz] = graph->block[bs * bs * q + (dof % bs) * bs + b];
            }
            nz++;
          }
      }
    }
    ci[row[patterns]] = nz;
    if (!pass) PetscCall(PetscMalloc2(nz, cj, nz, ca));
  }
  PetscFunctionReturn(0);
}

/* Schur complements on the interfaces of one subdomain, from the inverse F of its matrix on all of them (gamma x gamma) */
static PetscErrorCode LatinStiffnessSchur_Private(Latin latin, PetscInt s, PetscInt gamma, const PetscReal F[], const PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  LatinInterfaces *inter = &latin->inter;

  PetscFunctionBegin;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;
    PetscReal            *A    = S + first[f];
    PetscBLASInt          n, info = 0;

    if (!rows) continue;
    for (PetscInt j = 0; j < rows; j++)
      for (PetscInt i = 0; i < rows; i++) {
        const PetscInt a = at[inter->side_dof[face->side_first + i]], b = at[inter->side_dof[face->side_first + j]];

        A[i + rows * j] = 0.5 * (F[a + gamma * b] + F[b + gamma * a]);
      }
    PetscCall(PetscBLASIntCast(rows, &n));
    PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &n, A, &n, &info));
    if (!info) PetscCallBLAS("LAPACKpotri", LAPACKpotri_("L", &n, A, &n, &info));
    if (info) *bad = PETSC_TRUE;
    for (PetscInt j = 0; j < rows; j++)
      for (PetscInt i = 0; i < j; i++) A[i + rows * j] = A[j + rows * i];
  }
  PetscFunctionReturn(0);
}

/* The same for the subdomains list[] at once: one factorisation, a unit force on each interface dof */
static PetscErrorCode LatinStiffnessCondense_Private(Latin latin, LatinGraph *graph, PetscInt patterns, const PetscInt list[], const PetscReal spring[], PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinInterfaces   *inter  = &latin->inter;
  const PetscInt     bs     = latin->sub.bs;
  PetscInt           widest = 0, *row, *ci, *cj, *count, *dofs;
  size_t            *start;
  PetscReal         *ca, *F;
  Mat                K;
  KSP                ksp;
  PC                 pc;
  KSPConvergedReason failed = KSP_CONVERGED_ITERATING;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(patterns + 1, &row, patterns, &count, patterns + 1, &start));
  PetscCall(PetscMalloc1(inter->sides, &dofs)); /* the interface dofs of each pattern: from its first side on */
  row[0]   = 0;
  start[0] = 0;
  for (PetscInt p = 0; p < patterns; p++) {
    const PetscInt side = inter->interface[inter->offset[list[p]]].side_first, end = inter->interface[inter->offset[list[p] + 1] - 1].side_last;

    row[p + 1] = row[p] + bs * (sub->node_offset[list[p] + 1] - sub->node_offset[list[p]]);
    count[p]   = end - side;
    PetscCall(PetscArraycpy(dofs + side, inter->side_dof + side, end - side));
    PetscCall(PetscSortRemoveDupsInt(&count[p], dofs + side));
    for (PetscInt i = 0; i < count[p]; i++) at[dofs[side + i]] = i;
    start[p + 1] = start[p] + (size_t)count[p] * (size_t)count[p];
    widest       = PetscMax(widest, count[p]);
  }
  PetscCall(PetscMalloc1(row[patterns] + 1, &ci));
  PetscCall(LatinStiffnessMatrix_Private(latin, graph, patterns, list, row, spring, ci, &cj, &ca));
  PetscCall(PetscMalloc1(start[patterns], &F));
  PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, row[patterns], row[patterns], ci, cj, ca, &K));
  PetscCall(MatSetOption(K, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(K, MAT_SPD, PETSC_TRUE));
  PetscCall(KSPCreate(PETSC_COMM_SELF, &ksp));
  PetscCall(KSPSetOptionsPrefix(ksp, "set_up_")); /* options without prefix are for others */
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(LatinDirectSolver_Private(pc, K, MATSOLVERCHOLMOD));
  PetscCall(KSPSetOperators(ksp, K, K));
  for (PetscInt from = 0; from < widest && !*bad; from += LATIN_STIFFNESS_COLUMNS) {
    const PetscInt     to = PetscMin(from + LATIN_STIFFNESS_COLUMNS, widest);
    const size_t       n  = (size_t)row[patterns];
    Mat                B, X;
    PetscScalar       *b;
    const PetscScalar *x;

    PetscCall(LatinDenseCreate_Private(row[patterns], to - from, &B));
    PetscCall(LatinDenseCreate_Private(row[patterns], to - from, &X));
    PetscCall(MatDenseGetArrayWrite(B, &b));
    PetscCall(PetscMemzero(b, n * (size_t)(to - from) * sizeof(*b)));
    for (PetscInt p = 0; p < patterns; p++)
      for (PetscInt j = from; j < PetscMin(to, count[p]); j++) b[(size_t)(row[p] + dofs[inter->interface[inter->offset[list[p]]].side_first + j] - bs * sub->node_offset[list[p]]) + n * (size_t)(j - from)] = 1.0;
    PetscCall(MatDenseRestoreArrayWrite(B, &b));
    PetscCall(LatinDenseSolve_Private(ksp, B, X, &failed));
    if (failed) *bad = PETSC_TRUE;
    PetscCall(MatDenseGetArrayRead(X, &x));
    for (PetscInt p = 0; p < patterns; p++) {
      const PetscInt side = inter->interface[inter->offset[list[p]]].side_first;

      for (PetscInt j = from; j < PetscMin(to, count[p]); j++)
        for (PetscInt i = 0; i < count[p]; i++) F[start[p] + (size_t)i + (size_t)count[p] * (size_t)j] = x[(size_t)(row[p] + dofs[side + i] - bs * sub->node_offset[list[p]]) + n * (size_t)(j - from)];
    }
    PetscCall(MatDenseRestoreArrayRead(X, &x));
    PetscCall(MatDestroy(&B));
    PetscCall(MatDestroy(&X));
  }
  PetscCall(KSPDestroy(&ksp));
  PetscCall(MatDestroy(&K));
  PetscCall(PetscFree2(cj, ca));
  PetscCall(PetscFree(ci));
  for (PetscInt p = 0; p < patterns && !*bad; p++) PetscCall(LatinStiffnessSchur_Private(latin, list[p], count[p], F + start[p], at, first, S, bad));
  PetscCall(PetscFree(F));
  PetscCall(PetscFree(dofs));
  PetscCall(PetscFree3(row, count, start));
  PetscFunctionReturn(0);
}

/*
   The same for one subdomain with large interfaces: its inside is eliminated by a partial factorisation, which costs less
   than as many right-hand sides; the rest is dense.
*/
static PetscErrorCode LatinStiffnessPartial_Private(Latin latin, LatinGraph *graph, PetscInt s, const PetscReal spring[], PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  LatinInterfaces *inter = &latin->inter;
  const PetscInt   top = latin->sub.bs * latin->sub.node_offset[s], side = inter->interface[inter->offset[s]].side_first;
  PetscInt         row[2] = {0, latin->sub.bs * latin->sub.node_offset[s + 1] - top}, gamma = inter->interface[inter->offset[s + 1] - 1].side_last - side;
  PetscInt        *dofs, *ci, *cj;
  PetscReal       *ca;
  PetscBLASInt     n, info = 0;
  Mat              K, factor, dense;
  MatFactorInfo    how;
  MatFactorError   failed;
  PetscScalar     *F;
  IS               is;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(gamma, &dofs, row[1] + 1, &ci));
  PetscCall(PetscArraycpy(dofs, inter->side_dof + side, gamma));
  PetscCall(PetscSortRemoveDupsInt(&gamma, dofs));
  for (PetscInt i = 0; i < gamma; i++) {
    at[dofs[i]] = i;
    dofs[i] -= top;
  }
  PetscCall(LatinStiffnessMatrix_Private(latin, graph, 1, &s, row, spring, ci, &cj, &ca));
  PetscCall(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, row[1], row[1], ci, cj, ca, &K));
  PetscCall(MatSetOption(K, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(K, MAT_SPD, PETSC_TRUE));
  PetscCall(MatGetFactor(K, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, &factor));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, gamma, dofs, PETSC_USE_POINTER, &is));
  PetscCall(MatFactorSetSchurIS(factor, is));
  PetscCall(MatFactorInfoInitialize(&how));
  PetscCall(MatCholeskyFactorSymbolic(factor, K, NULL, &how));
  PetscCall(MatCholeskyFactorNumeric(factor, K, &how));
  PetscCall(MatFactorGetError(factor, &failed)); /* noted, not raised */
  if (failed) *bad = PETSC_TRUE;
  PetscCall(MatFactorCreateSchurComplement(factor, &dense, NULL));
  PetscCall(MatDestroy(&factor));
  PetscCall(PetscBLASIntCast(gamma, &n));
  PetscCall(MatDenseGetArray(dense, &F));
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &n, F, &n, &info));
  if (!info) PetscCallBLAS("LAPACKpotri", LAPACKpotri_("L", &n, F, &n, &info));
  if (info) *bad = PETSC_TRUE;
  for (PetscInt j = 0; j < gamma; j++)
    for (PetscInt i = 0; i < j; i++) F[i + (size_t)gamma * (size_t)j] = F[j + (size_t)gamma * (size_t)i];
  if (!*bad) PetscCall(LatinStiffnessSchur_Private(latin, s, gamma, F, at, first, S, bad));
  PetscCall(MatDenseRestoreArray(dense, &F));
  PetscCall(MatDestroy(&dense));
  PetscCall(MatDestroy(&K));
  PetscCall(ISDestroy(&is));
  PetscCall(PetscFree2(cj, ca));
  PetscCall(PetscFree2(dofs, ci));
  PetscFunctionReturn(0);
}

/* The same for a subdomain that has been condensed on its interfaces (interior.c): its operator is dense */
static PetscErrorCode LatinStiffnessDense_Private(Latin latin, const PetscReal spring[], PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  const PetscInt width = latin->sub.copies;
  PetscBLASInt   n, info = 0;
  PetscReal     *F;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(width, &n));
  PetscCall(PetscMalloc1(width * width, &F));
  PetscCall(PetscArraycpy(F, latin->sub.ka, width * width));
  for (PetscInt i = 0; i < width; i++) {
    F[i + width * i] += spring[i];
    at[i] = i;
  }
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &n, F, &n, &info));
  if (!info) PetscCallBLAS("LAPACKpotri", LAPACKpotri_("L", &n, F, &n, &info));
  if (info) *bad = PETSC_TRUE;
  for (PetscInt j = 0; j < width; j++)
    for (PetscInt i = 0; i < j; i++) F[i + width * j] = F[j + width * i];
  if (!*bad) PetscCall(LatinStiffnessSchur_Private(latin, 0, width, F, at, first, S, bad));
  PetscCall(PetscFree(F));
  PetscFunctionReturn(0);
}

/* All of them. Without a subdomain's own factor those of like size together: the right-hand sides are as many as the largest of a matrix needs */
static PetscErrorCode LatinStiffnessCondenseAll_Private(Latin latin, LatinGraph *graph, PetscInt patterns, PetscInt list[], const PetscReal spring[], PetscInt at[], const size_t first[], PetscReal S[], PetscBool *bad)
{
  LatinInterfaces *inter = &latin->inter;
  PetscInt        *width, many;
  PetscBool        partial;
  Mat              one;

  PetscFunctionBegin;
  if (latin->interior) {
    if (patterns) PetscCall(LatinStiffnessDense_Private(latin, spring, at, first, S, bad));
    PetscFunctionReturn(0);
  }
  PetscCall(MatCreateSeqAIJ(PETSC_COMM_SELF, 1, 1, 1, NULL, &one));
  PetscCall(MatGetFactorAvailable(one, MATSOLVERMUMPS, MAT_FACTOR_CHOLESKY, &partial));
  PetscCall(MatDestroy(&one));
  PetscCall(PetscMalloc1(patterns, &width));
  for (PetscInt p = 0; p < patterns; p++) width[p] = inter->interface[inter->offset[list[p] + 1] - 1].side_last - inter->interface[inter->offset[list[p]]].side_first;
  PetscCall(PetscSortIntWithArray(patterns, width, list));
  for (many = patterns; partial && many > 0 && width[many - 1] >= LATIN_STIFFNESS_PARTIAL;) many--;
  for (PetscInt p = many; p < patterns && !*bad; p++) PetscCall(LatinStiffnessPartial_Private(latin, graph, list[p], spring, at, first, S, bad));
  patterns = many;
  PetscCall(PetscFree(width));
  for (PetscInt p = 0; p < patterns && !*bad; p += LATIN_BLOCK_PATTERNS) PetscCall(LatinStiffnessCondense_Private(latin, graph, PetscMin(LATIN_BLOCK_PATTERNS, patterns - p), list + p, spring, at, first, S, bad));
  PetscFunctionReturn(0);
}

/*
   The matrix of each interface side with whole[f], its own subdomain's part: S + first[f], column-major, once for equal
   subdomains. The caller frees S. Collective on latin.
*/
PetscErrorCode LatinStiffnessFaces_Private(Latin latin, const PetscBool whole[], size_t first[], PetscReal **S)
{
  LatinSubstructure *sub   = &latin->sub;
  LatinInterfaces   *inter = &latin->inter;
  const PetscInt     bs = latin->sub.bs, n = bs * sub->copies;
  PetscInt          *pattern, *list, *at, patterns = 0;
  PetscReal         *spring;
  PetscBool         *wanted, bad = PETSC_FALSE;
  size_t             used = 0;
  LatinGraph         graph;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3(sub->n, &list, n, &at, n, &spring));
  PetscCall(PetscCalloc1(sub->n, &wanted));
  PetscCall(PetscFree(latin->macro.like));
  PetscCall(PetscMalloc1(sub->n, &latin->macro.like));
  PetscCall(LatinBlocksCompare_Private(latin, PETSC_FALSE, latin->macro.like));
  pattern = latin->macro.like;
  for (PetscInt i = 0; i < n; i++) at[i] = -1;
  for (PetscInt f = 0; f < inter->count; f++) wanted[pattern[inter->interface[f].sub]] = (PetscBool)(wanted[pattern[inter->interface[f].sub]] || whole[f]);
  for (PetscInt s = 0; s < sub->n; s++) {
    if (pattern[s] == s && wanted[s]) list[patterns++] = s;
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
      const size_t rows = (size_t)(inter->interface[f].side_last - inter->interface[f].side_first);

      first[f] = pattern[s] == s ? used : first[inter->offset[pattern[s]] + f - inter->offset[s]];
      if (pattern[s] == s && wanted[s]) used += rows * rows;
    }
  }
  PetscCall(PetscMalloc1(used, S));
  PetscCall(LatinStiffnessFoundation_Private(latin, spring));
  PetscCall(LatinGraphCreate_Private(latin, PETSC_TRUE, &graph));
  if (LatinDirectionKind(latin) != LATIN_DIRECTION_BLOCK) {
    LatinEach(PetscObjectComm((PetscObject)latin), LatinStiffnessCondenseAll_Private(latin, &graph, patterns, list, spring, at, first, *S, &bad));
  } else {
    for (PetscInt p = 0; p < patterns; p++)
      for (PetscInt f = inter->offset[list[p]]; f < inter->offset[list[p] + 1]; f++) PetscCall(LatinStiffnessBlock_Private(latin, &graph, &inter->interface[f], spring, at, *S + first[f]));
  }
  PetscCall(LatinGraphDestroy_Private(&graph));
  PetscCall(PetscFree3(list, at, spring));
  PetscCall(PetscFree(wanted));
  LatinAgree(PetscObjectComm((PetscObject)latin), bad, PETSC_ERR_CONV_FAILED, "The stiffness of a subdomain on its interfaces could not be computed; choose another -%sdirection, e.g. diagonal",
             ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "");
  PetscFunctionReturn(0);
}
