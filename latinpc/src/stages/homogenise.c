#include "stages/latinstages.h"

/*
   Condensation of the subdomains on their coarse dofs, (45)-(51). With r the dofs that are not primal, C the primal ones, A the macro functionals (rows
   (D R)^t, so that A U is the macro displacement):

     V_m = K_rr^-1 A_r^t,  V_C = K_rr^-1 K_rC,  T = A_r V_m,  N = A_C - A_r V_C,
     H   = [ T^-1 - 1        -T^-1 N                        ]
           [ -N^t T^-1       K_CC - K_Cr V_C + N^t T^-1 N   ]
     Phi = [ V_m T^-1        -V_C - V_m T^-1 N              ]  on r,  (0, 1) on C

   A factor that keeps the primal rows gives their Schur complement K_CC - K_Cr V_C, and the forward substitution of V_m leaves -V_C^t A_r^t in them.
   Then V_m alone is computed, in rows of interfaces, and stored in place of Phi.

   K contains springs on the macro displacement, but the method has none (only the micro part has a search direction). As R^t D R = 1, their energy is
   |A U|^2 / 2: hence the identity subtracted from T^-1, as in (29).
*/

#define LATIN_HOMOGENISE_COLUMNS 16 /* right-hand sides solved together: the work space is that many copies of U */

#define LATIN_INVERSE_ROWS   512 /* most rows of a dense inverse, 2 MB, as in a second-level cache */
#define LATIN_INVERSE_RUN    8   /* least members of a batch for each run of consecutive subdomain numbers; with fewer a product is bound by memory */
#define LATIN_INVERSE_STAGES 8   /* most columns of an inverse, in right-hand sides of so many linear stages */

/* Work arrays of the condensation of a subdomain */
typedef struct {
  PetscInt columns; /* number of columns of B, V and G: all coarse dofs or, if the factor keeps the primal rows, the macro ones */
  /* number of rows in which B may be nonzero; these, increasing; [rows of the subdomain] their positions among these, -1: none */
  PetscInt     rows, *row, *at;
  PetscScalar *B, *V, *G; /* [A_r^t, K_rC] and K_rr^-1 B, in these rows; B^t V */
} LatinCondensation;

/* Lists row and at: the rows of subdomain s at shared nodes, on interfaces, on primal dofs, or coupled to these */
static PetscErrorCode LatinHomogeniseRows_Private(const LatinLinear *linear, PetscInt s, LatinCondensation *work)
{
  const LatinInterfaces *inter = linear->inter;
  const PetscInt         bs = linear->sub->bs, top = bs * linear->sub->node_offset[s], n = bs * linear->sub->node_offset[s + 1] - top;

  PetscFunctionBegin;
  PetscCall(PetscMalloc2(n, &work->row, n, &work->at));
  for (PetscInt r = 0; r < n; r++) work->at[r] = inter->share_offset[(top + r) / bs] < inter->share_offset[(top + r) / bs + 1] || inter->primal_index[top + r] >= 0 ? 0 : -1;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) work->at[inter->side_dof[k] - top] = 0;
  for (PetscInt c = linear->rc_first[s]; c < linear->rc_last[s]; c++) work->at[linear->rc[c].row] = 0;
  work->rows = 0;
  for (PetscInt r = 0; r < n; r++)
    if (work->at[r] == 0) {
      work->at[r]             = work->rows;
      work->row[work->rows++] = r;
    }
  PetscFunctionReturn(0);
}

/* Assembles B = [A_r^t, K_rC] of subdomain s */
static PetscErrorCode LatinHomogeniseColumns_Private(const LatinLinear *linear, PetscInt s, LatinCondensation *work)
{
  const LatinInterfaces *inter = linear->inter;
  const PetscInt         top   = linear->sub->bs * linear->sub->node_offset[s];
  const size_t           rows  = (size_t)work->rows;

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(rows * (size_t)work->columns, &work->B));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    PetscScalar          *b    = work->B + rows * (size_t)linear->macro->of[f].at;

    for (PetscInt k = face->side_first; k < face->side_last; k++)
      for (PetscInt j = 0; j < linear->macro->of[f].modes && inter->primal_index[inter->side_dof[k]] < 0; j++) b[(size_t)work->at[inter->side_dof[k] - top] + rows * (size_t)j] += LatinMacroDualRow(linear->macro, f, k)[j];
  }
  for (PetscInt c = linear->rc_first[s]; c < linear->rc_last[s]; c++) work->B[(size_t)work->at[linear->rc[c].row] + rows * (size_t)(linear->coarse->macro_count[s] + linear->rc[c].primal)] += linear->rc[c].value;
  PetscFunctionReturn(0);
}

/* Computes phi, all rows of K_rr^-1 B, m columns, by blocks of columns. *failed: the reason of a failure */
static PetscErrorCode LatinHomogeniseSolve_Private(LatinLinear *linear, PetscInt which, PetscInt m, const LatinCondensation *work, PetscScalar phi[], KSPConvergedReason *failed)
{
  const PetscInt n = linear->batches->batch[which].rows;
  KSP            ksp;

  PetscFunctionBegin;
  PetscCall(LatinSolverAccurate_Private(linear->solvers->ksp[which], linear->solvers->direct, &ksp));
  for (PetscInt first = 0; first < m; first += LATIN_HOMOGENISE_COLUMNS) {
    const PetscInt last = PetscMin(first + LATIN_HOMOGENISE_COLUMNS, m);
    Mat            B, X;
    PetscScalar   *b;

    PetscCall(LatinDenseCreate_Private(n, last - first, &B));
    PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, n, last - first, phi + (size_t)n * (size_t)first, &X));
    PetscCall(MatDenseGetArrayWrite(B, &b));
    PetscCall(PetscMemzero(b, (size_t)n * (size_t)(last - first) * sizeof(*b)));
    for (PetscInt j = first; j < last; j++, b += n)
      for (PetscInt k = 0; k < work->rows; k++) b[work->row[k]] = work->B[(size_t)k + (size_t)work->rows * (size_t)j];
    PetscCall(MatDenseRestoreArrayWrite(B, &b));
    PetscCall(LatinDenseSolve_Private(ksp, B, X, failed));
    PetscCall(MatDestroy(&B));
    PetscCall(MatDestroy(&X));
  }
  PetscCall(KSPDestroy(&ksp));
  PetscFunctionReturn(0);
}

/* The same with the dense inverse of the batch */
static PetscErrorCode LatinHomogeniseProduct_Private(const LatinLinear *linear, PetscInt which, PetscInt m, const LatinCondensation *work, PetscScalar phi[])
{
  const size_t      n   = (size_t)linear->batches->batch[which].rows;
  const PetscScalar one = 1.0, zero = 0.0;
  PetscBLASInt      rows, columns;
  PetscScalar      *B;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(linear->batches->batch[which].rows, &rows));
  PetscCall(PetscBLASIntCast(m, &columns));
  PetscCall(PetscCalloc1(n * (size_t)m, &B));
  for (size_t j = 0; j < (size_t)m; j++)
    for (PetscInt k = 0; k < work->rows; k++) B[(size_t)work->row[k] + n * j] = work->B[(size_t)k + (size_t)work->rows * j];
  if (n && m) PetscCallBLAS("BLASsymm", BLASsymm_("L", "L", &rows, &columns, &one, linear->inverse[which], &rows, B, &rows, &zero, phi, &rows));
  PetscCall(PetscLogFlops(2.0 * rows * rows * columns));
  PetscCall(PetscFree(B));
  PetscFunctionReturn(0);
}

/* Computes G = B^t V, m columns each: the lower triangle by blocks, mirrored */
static PetscErrorCode LatinHomogeniseEnergies_Private(LatinCondensation *work, PetscInt m, const PetscScalar V[])
{
  const PetscScalar one = 1.0, zero = 0.0;
  const size_t      n = (size_t)work->rows;
  PetscBLASInt      rows, columns, ld, all;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(work->rows, &ld));
  PetscCall(PetscBLASIntCast(m, &all));
  if (!n) PetscCall(PetscArrayzero(work->G, (size_t)m * (size_t)m));
  for (PetscInt first = 0; first < m && n; first += LATIN_BATCH_COLUMNS) {
    rows    = all - (PetscBLASInt)first;
    columns = PetscMin(LATIN_BATCH_COLUMNS, rows);
    PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &rows, &columns, &ld, &one, work->B + n * (size_t)first, &ld, V + n * (size_t)first, &ld, &zero, work->G + (size_t)first + (size_t)m * (size_t)first, &all));
    PetscCall(PetscLogFlops(2.0 * (PetscLogDouble)n * rows * columns));
  }
  for (PetscInt j = 0; j < m; j++)
    for (PetscInt i = 0; i < j; i++) work->G[(size_t)i + (size_t)m * (size_t)j] = work->G[(size_t)j + (size_t)m * (size_t)i];
  PetscFunctionReturn(0);
}

/*
   Computes [V_m, V_C] in Phi, and G = B^t [V_m, V_C], from which H follows. If the factor keeps the primal rows, Phi is V_m in the rows of B; the
   primal rows of V_m hold -V_C^t A_r^t until LatinHomogeniseKept_Private() takes them
*/
static PetscErrorCode LatinHomogeniseVectors_Private(LatinLinear *linear, PetscInt which, LatinCondensation *work, KSPConvergedReason *failed)
{
  const PetscBool some = linear->keeps[which];
  const PetscInt  s = linear->batches->batch[which].sub[0], m = work->columns;
  const size_t    entries = (size_t)work->rows * (size_t)m;
  LatinPhi       *Phi     = &linear->Phi[s];
  Mat             F;

  PetscFunctionBegin;
  Phi->rows = some ? work->rows : linear->batches->batch[which].rows;
  PetscCall(PetscMalloc2(some ? work->rows : 0, &Phi->row, (size_t)Phi->rows * (size_t)m, &Phi->a));
  if (some) {
    PetscCall(PetscArraycpy(Phi->row, work->row, work->rows));
    PetscCall(PetscArraycpy(Phi->a, work->B, entries));
    PetscCall(LatinSubstructuresFactor(linear, which, &F));
    PetscCall(LatinCholeskySolveSome(F, work->rows, work->row, m, Phi->a));
  } else if (linear->solvers->ksp[which]) PetscCall(LatinHomogeniseSolve_Private(linear, which, m, work, Phi->a, failed));
  else PetscCall(LatinHomogeniseProduct_Private(linear, which, m, work, Phi->a));
  PetscCall(PetscMalloc2(some ? 0 : entries, &work->V, (size_t)m * (size_t)m, &work->G));
  for (PetscInt j = 0; j < m && !some; j++)
    for (PetscInt k = 0; k < work->rows; k++) work->V[(size_t)k + (size_t)work->rows * (size_t)j] = Phi->a[(size_t)work->row[k] + (size_t)Phi->rows * (size_t)j];
  PetscCall(LatinHomogeniseEnergies_Private(work, m, some ? Phi->a : work->V));
  PetscFunctionReturn(0);
}

/* For a factor that keeps the primal rows: adds their Schur complement to H, and moves the primal rows of V_m to N */
static PetscErrorCode LatinHomogeniseKept_Private(const LatinLinear *linear, PetscInt which, const LatinCondensation *work, PetscScalar N[], PetscScalar H[])
{
  const PetscInt  s = linear->batches->batch[which].sub[0], m = linear->coarse->offset[s + 1] - linear->coarse->offset[s], macros = work->columns, primals = m - macros;
  const PetscInt  top = linear->sub->bs * linear->sub->node_offset[s], *dof = linear->inter->primal_dof + linear->inter->primal_offset[s];
  const LatinPhi *Phi = &linear->Phi[s];
  PetscReal      *S;
  Mat             F;

  PetscFunctionBegin;
  PetscCall(LatinSubstructuresFactor(linear, which, &F));
  PetscCall(LatinCholeskyTakeSchur(F, &S));
  for (PetscInt j = 0; j < primals; j++) {
    PetscReal *row = Phi->a + work->at[dof[j] - top];

    for (PetscInt i = 0; i < macros; i++, row += Phi->rows) {
      N[i + macros * j] = *row;
      *row              = 0.0;
    }
    for (PetscInt i = 0; i < primals; i++) H[macros + i + m * (macros + j)] = linear->sub->fixed[dof[i]] || linear->sub->fixed[dof[j]] ? 0.0 : S[i + (size_t)primals * (size_t)j];
  }
  PetscCall(PetscFree(S));
  PetscFunctionReturn(0);
}

/*
   Computes T (macros x macros) and N = A_C - A_r V_C (macros x primals) of subdomain s from G; subtracts K_Cr V_C from H. If the factor keeps the
   primal rows, only A_C is added to N: LatinHomogeniseKept_Private() has done the rest
*/
static void LatinHomogeniseMacro(const LatinLinear *linear, PetscInt s, const LatinCondensation *work, PetscScalar T[], PetscScalar N[], PetscScalar H[])
{
  const PetscScalar     *G      = work->G;
  const LatinInterfaces *inter  = linear->inter;
  const PetscInt         macros = linear->coarse->macro_count[s], m = linear->coarse->offset[s + 1] - linear->coarse->offset[s];

  for (PetscInt j = 0; j < macros; j++)
    for (PetscInt i = 0; i < macros; i++) T[i + macros * j] = G[i + work->columns * j];
  for (PetscInt j = macros; j < work->columns; j++) {
    for (PetscInt i = 0; i < macros; i++) N[i + macros * (j - macros)] = -G[i + m * j];
    for (PetscInt i = macros; i < m; i++) H[i + m * j] -= G[i + m * j];
  }
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++)
    for (PetscInt k = inter->interface[f].side_first; k < inter->interface[f].side_last; k++) {
      const PetscInt primal = inter->primal_index[inter->side_dof[k]];

      for (PetscInt i = 0; i < linear->macro->of[f].modes && primal >= 0; i++) N[linear->macro->of[f].at + i + macros * primal] += LatinMacroDualRow(linear->macro, f, k)[i];
    }
}

/* Sets the blocks of H (m x m), which holds K_CC - K_Cr V_C, from T^-1 (macros x macros) and N; TN becomes T^-1 N */
static PetscErrorCode LatinHomogeniseStiffness_Private(PetscInt macros, PetscInt m, const PetscScalar T[], const PetscScalar N[], PetscScalar TN[], PetscScalar H[])
{
  const PetscInt    primals = m - macros;
  const PetscScalar one = 1.0, zero = 0.0;
  PetscBLASInt      bm, bp, bl;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(macros, &bm));
  PetscCall(PetscBLASIntCast(primals, &bp));
  PetscCall(PetscBLASIntCast(m, &bl));
  for (PetscInt j = 0; j < macros; j++)
    for (PetscInt i = 0; i < macros; i++) H[i + m * j] = T[i + macros * j] - (i == j ? 1.0 : 0.0);
  if (!primals) PetscFunctionReturn(0);
  PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &bm, &bp, &bm, &one, T, &bm, N, &bm, &zero, TN, &bm));
  for (PetscInt j = 0; j < primals; j++)
    for (PetscInt i = 0; i < macros; i++) H[i + m * (macros + j)] = H[macros + j + m * i] = -TN[i + macros * j];
  PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &bp, &bp, &bm, &one, N, &bm, TN, &bm, &one, H + macros + m * macros, &bl));
  PetscCall(PetscLogFlops(2.0 * (PetscLogDouble)macros * primals * m));
  PetscFunctionReturn(0);
}

/*
   Turns phi, [V_m, -V_C] (rows x macros and primals), to [V_m T^-1, -V_C - V_m T^-1 N]. inverse: NULL, or K_rr^-1, which becomes
   K_rr^-1 - V_m T^-1 V_m^t, the inverse under zero coarse displacements
*/
static PetscErrorCode LatinHomogenisePhi_Private(PetscInt rows, PetscInt macros, PetscInt primals, const PetscScalar T[], const PetscScalar TN[], PetscScalar phi[], PetscScalar inverse[])
{
  const size_t      entries = (size_t)rows * (size_t)macros; /* of V_m */
  const PetscScalar one = 1.0, zero = 0.0, minus = -1.0;
  PetscScalar      *VT;
  PetscBLASInt      br, bm, bp;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(PetscMax(rows, 1), &br));
  PetscCall(PetscBLASIntCast(macros, &bm));
  PetscCall(PetscBLASIntCast(primals, &bp));
  PetscCall(PetscMalloc1(entries, &VT));
  if (primals) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &br, &bp, &bm, &minus, phi, &br, TN, &bm, &one, phi + entries, &br));
  PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &br, &bm, &bm, &one, phi, &br, T, &bm, &zero, VT, &br));
  if (inverse) PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &br, &br, &bm, &minus, VT, &br, phi, &br, &one, inverse, &br));
  PetscCall(PetscArraycpy(phi, VT, entries));
  PetscCall(PetscFree(VT));
  PetscCall(PetscLogFlops(2.0 * (PetscLogDouble)macros * br * (primals + macros + (inverse ? br : 0))));
  PetscFunctionReturn(0);
}

/* Computes H, which holds K_CC on entry, and Phi of the first subdomain of a batch. *singular: T is not positive definite */
static PetscErrorCode LatinHomogeniseSubdomain_Private(LatinLinear *linear, PetscInt which, const LatinCondensation *work, PetscBool *singular)
{
  const PetscBool kept = linear->keeps[which];
  const PetscInt  s = linear->batches->batch[which].sub[0], m = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
  const PetscInt  macros = linear->coarse->macro_count[s], primals = m - macros, rows = linear->Phi[s].rows, top = linear->sub->bs * linear->sub->node_offset[s];
  PetscScalar    *H = linear->stiffness.H + linear->stiffness.h_offset[s], *primal_phi = linear->Phi[s].a + (size_t)rows * (size_t)macros, *T, *N, *TN;

  PetscFunctionBegin;
  PetscCall(PetscMalloc3((size_t)macros * macros, &T, (size_t)macros * primals, &N, (size_t)macros * primals, &TN));
  if (kept) PetscCall(LatinHomogeniseKept_Private(linear, which, work, N, H));
  LatinHomogeniseMacro(linear, s, work, T, N, H);
  PetscCall(LatinSPDInverse_Private(macros, T, singular));
  if (macros && !*singular) PetscCall(LatinHomogeniseStiffness_Private(macros, m, T, N, TN, H));
  if (!kept) {
    for (size_t i = 0; i < (size_t)rows * (size_t)primals; i++) primal_phi[i] = -primal_phi[i];
    if (macros && !*singular) PetscCall(LatinHomogenisePhi_Private(rows, macros, primals, T, TN, linear->Phi[s].a, linear->inverse[which]));
    for (PetscInt p = 0; p < primals; p++) primal_phi[(size_t)(linear->inter->primal_dof[linear->inter->primal_offset[s] + p] - top) + (size_t)rows * (size_t)p] = 1.0;
  }
  PetscCall(PetscFree3(T, N, TN));
  /* symmetric to the bit, whatever the rounding above */
  for (PetscInt j = 0; j < m; j++)
    for (PetscInt i = 0; i < j; i++) H[i + m * j] = H[j + m * i] = 0.5 * (H[i + m * j] + H[j + m * i]);
  PetscFunctionReturn(0);
}

/* Whether batch `which` uses a dense inverse, given or to be computed by a direct solver: it pays for few rows and many members */
PetscBool LatinHomogeniseInverts(const LatinLinear *linear, PetscInt which)
{
  const LatinBatch *batch = &linear->batches->batch[which];
  PetscInt          runs  = 1;

  if (linear->inverse[which]) return PETSC_TRUE;
  for (PetscInt m = 1; m < batch->members; m++) runs += batch->sub[m] != batch->sub[m - 1] + 1 ? 1 : 0;
  return (PetscBool)(batch->rows <= LATIN_INVERSE_ROWS && batch->members >= LATIN_INVERSE_RUN * runs && batch->members * LATIN_INVERSE_STAGES >= batch->rows);
}

/*
   Computes K_rr^-1 of a batch of many equal subdomains with consecutive numbers: one product with it, of many columns in place, is faster than
   substitutions. Prescribed and primal rows and columns are zero.
*/
static PetscErrorCode LatinHomogeniseInverse_Private(LatinLinear *linear, PetscInt which, KSPConvergedReason *failed)
{
  const LatinBatch *batch = &linear->batches->batch[which];
  const PetscInt    n = batch->rows, first = linear->sub->bs * linear->sub->node_offset[batch->sub[0]];
  Mat               B, X;
  PetscScalar      *b;

  PetscFunctionBegin;
  if (linear->inverse[which] || !linear->solvers->direct || !LatinHomogeniseInverts(linear, which)) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(n * n, &linear->inverse[which]));
  PetscCall(LatinDenseCreate_Private(n, n, &B));
  PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, n, n, linear->inverse[which], &X));
  PetscCall(MatDenseGetArrayWrite(B, &b));
  PetscCall(PetscArrayzero(b, n * n));
  for (PetscInt i = 0; i < n; i++) b[i + n * i] = linear->sub->fixed[first + i] || linear->inter->primal_index[first + i] >= 0 ? 0.0 : 1.0;
  PetscCall(MatDenseRestoreArrayWrite(B, &b));
  PetscCall(LatinDenseSolve_Private(linear->solvers->ksp[which], B, X, failed));
  PetscCall(MatDestroy(&B));
  PetscCall(MatDestroy(&X));
  PetscFunctionReturn(0);
}

/* Condenses the first subdomain of a batch, for all of them */
static PetscErrorCode LatinHomogeniseBatch_Private(LatinLinear *linear, PetscInt which, KSPConvergedReason *failed, PetscBool *singular)
{
  const PetscInt    s    = linear->batches->batch[which].sub[0];
  LatinCondensation work = {.columns = linear->keeps[which] ? linear->coarse->macro_count[s] : linear->coarse->offset[s + 1] - linear->coarse->offset[s]};

  PetscFunctionBegin;
  PetscCall(LatinHomogeniseInverse_Private(linear, which, failed));
  if (linear->coarse->offset[s + 1] == linear->coarse->offset[s]) PetscFunctionReturn(0);
  PetscCall(LatinHomogeniseRows_Private(linear, s, &work));
  PetscCall(LatinHomogeniseColumns_Private(linear, s, &work));
  PetscCall(LatinHomogeniseVectors_Private(linear, which, &work, failed));
  PetscCall(LatinHomogeniseSubdomain_Private(linear, which, &work, singular));
  for (PetscInt k = 1; k < linear->batches->batch[which].members; k++) linear->Phi[linear->batches->batch[which].sub[k]] = linear->Phi[s];
  PetscCall(PetscFree2(work.row, work.at));
  PetscCall(PetscFree(work.B));
  PetscCall(PetscFree2(work.V, work.G));
  PetscFunctionReturn(0);
}

/* Computes H and Phi of all subdomains. Collective on sub->object */
PetscErrorCode LatinHomogeniseSetUp(LatinLinear *linear)
{
  KSPConvergedReason failed = KSP_CONVERGED_ITERATING;
  PetscInt           bad = -1, most = 0;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Condense, linear->sub->object, 0, 0, 0));
  if (linear->substructures) {
    PetscCall(LatinSubstructuresStiffness(linear));
    PetscCall(PetscLogEventEnd(LATIN_Condense, linear->sub->object, 0, 0, 0));
    PetscFunctionReturn(0);
  }
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const PetscInt s        = linear->batches->batch[b].sub[0];
    PetscBool      singular = PETSC_FALSE;

    PetscCall(LatinHomogeniseBatch_Private(linear, b, &failed, &singular));
    if (singular && (bad < 0 || s < bad)) bad = s;
    if (linear->keeps[b]) most = PetscMax(most, linear->Phi[s].rows);
  }
  PetscCall(PetscMalloc1(most, &linear->some));
  PetscCall(PetscLogEventEnd(LATIN_Condense, linear->sub->object, 0, 0, 0));
  LatinAgree(PetscObjectComm(linear->sub->object), failed, PETSC_ERR_CONV_FAILED, "A local solver failed during the condensation of the subdomains (%s); change its options, which start with -%slocal_", KSPConvergedReasons[failed],
             LatinPrefix(linear->sub));
  LatinAgree(PetscObjectComm(linear->sub->object), bad >= 0, PETSC_ERR_PLIB, "The macro constraints of subdomain %" PetscInt_FMT " are dependent to rounding; change the partition, or try variant none", linear->sub->first + bad);
  PetscFunctionReturn(0);
}
