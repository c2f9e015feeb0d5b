#include "stages/latinstages.h"

/*
   Condensation of the subdomains on their coarse dofs, (45)-(51). With r the dofs that are not primal, C the primal
   ones, A the macro functionals (rows (d R)^t, so that A U is the macro displacement):

     V_m = K_rr^-1 A_r^t,  V_C = K_rr^-1 K_rC,  T = A_r V_m,  N = A_C - A_r V_C,
     H   = [ T^-1 - 1        -T^-1 N                        ]
           [ -N^t T^-1       K_CC - K_Cr V_C + N^t T^-1 N   ]
     Phi = [ V_m T^-1        -V_C - V_m T^-1 N              ]  on r,  (0, 1) on C

   The springs of the macro displacement are in K but not in the method (the micro part alone has a search direction):
   with R^t d R = 1 their energy is |A U|^2 / 2, whence the identity taken from T^-1, as in (29).
*/

#define LATIN_HOMOGENISE_COLUMNS 16  /* right-hand sides solved together, at least: where a subdomain is large they bound the work space to that many copies of U */
#define LATIN_HOMOGENISE_ROOM    1e6 /* numbers, 8 MB, that more of them may fill: up to LATIN_BATCH_COLUMNS, which take two thirds of the time */

#define LATIN_INVERSE_ROWS   512 /* rows of the largest dense inverse, 2 MB */
#define LATIN_INVERSE_RUN    8   /* fewest subdomains of neighbouring numbers, on average */
#define LATIN_INVERSE_STAGES 8   /* the columns of an inverse are no more than the right-hand sides of so many linear stages */

/* Columns first..last of [A_r^t, K_rC] of subdomain s */
static PetscErrorCode LatinHomogeniseColumns_Private(LatinLinear *linear, PetscInt s, size_t n, PetscInt first, PetscInt last, PetscScalar b[])
{
  const LatinInterfaces *inter = linear->inter;
  const PetscInt         top   = linear->sub->bs * linear->sub->node_offset[s];

  PetscFunctionBegin;
  PetscCall(PetscMemzero(b, n * (size_t)(last - first) * sizeof(*b)));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        at   = linear->macro->of[f].at;

    for (PetscInt j = PetscMax(first, at); j < PetscMin(last, at + linear->macro->of[f].modes); j++)
      for (PetscInt k = face->side_first; k < face->side_last; k++)
        if (inter->primal_index[inter->side_dof[k]] < 0) b[(size_t)(inter->side_dof[k] - top) + n * (size_t)(j - first)] += LatinMacroDualRow(linear->macro, f, k)[j - at];
  }
  for (PetscInt c = linear->rc_first[s]; c < linear->rc_last[s]; c++) {
    const PetscInt j = linear->coarse->macro_count[s] + linear->rc[c].primal;

    if (j >= first && j < last) b[(size_t)linear->rc[c].row + n * (size_t)(j - first)] += linear->rc[c].value;
  }
  PetscFunctionReturn(0);
}

/* Phi first holds [V_m, V_C] */
static PetscErrorCode LatinHomogeniseSolve_Private(LatinLinear *linear, PetscInt which, KSPConvergedReason *failed)
{
  const PetscInt s = linear->batches->batch[which].sub[0], n = linear->batches->batch[which].rows, m = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
  PetscReal     *Phi     = linear->Phi + linear->phi_offset[s];
  const PetscInt columns = PetscMax(LATIN_HOMOGENISE_COLUMNS, PetscMin(LATIN_BATCH_COLUMNS, (PetscInt)(LATIN_HOMOGENISE_ROOM / PetscMax(n, 1))));
  KSP            ksp;

  PetscFunctionBegin;
  PetscCall(LatinSolverAccurate_Private(linear->solvers->ksp[which], linear->solvers->direct, &ksp));
  for (PetscInt first = 0; first < m; first += columns) {
    const PetscInt last = PetscMin(first + columns, m);
    Mat            B, X;
    PetscScalar   *b;

    PetscCall(LatinDenseCreate_Private(n, last - first, &B));
    PetscCall(MatCreateSeqDense(PETSC_COMM_SELF, n, last - first, Phi + (size_t)n * (size_t)first, &X));
    PetscCall(MatDenseGetArrayWrite(B, &b));
    PetscCall(LatinHomogeniseColumns_Private(linear, s, (size_t)n, first, last, b));
    PetscCall(MatDenseRestoreArrayWrite(B, &b));
    PetscCall(LatinDenseSolve_Private(ksp, B, X, failed));
    PetscCall(MatDestroy(&B));
    PetscCall(MatDestroy(&X));
  }
  PetscCall(KSPDestroy(&ksp));
  PetscFunctionReturn(0);
}

/* T (macros x macros) and N (macros x primals) of one subdomain, from [V_m, V_C] in phi */
static PetscErrorCode LatinHomogeniseMacro_Private(LatinLinear *linear, PetscInt s, const PetscScalar phi[], PetscScalar T[], PetscScalar N[])
{
  const LatinInterfaces *inter = linear->inter;
  const PetscInt         bs = linear->sub->bs, top = bs * linear->sub->node_offset[s];
  const PetscInt         macros = linear->coarse->macro_count[s], columns = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
  const size_t           rows = (size_t)(bs * (linear->sub->node_offset[s + 1] - linear->sub->node_offset[s]));

  PetscFunctionBegin;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        at   = linear->macro->of[f].at;

    for (PetscInt i = 0; i < linear->macro->of[f].modes; i++) {
      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        const PetscInt  dof = inter->side_dof[k], primal = linear->inter->primal_index[dof];
        const PetscReal a = LatinMacroDualRow(linear->macro, f, k)[i];

        if (primal >= 0) {
          N[at + i + macros * primal] += a;
          continue;
        }
        for (PetscInt j = 0; j < macros; j++) T[at + i + macros * j] += a * phi[(size_t)(dof - top) + rows * (size_t)j];
        for (PetscInt j = macros; j < columns; j++) N[at + i + macros * (j - macros)] -= a * phi[(size_t)(dof - top) + rows * (size_t)j];
      }
    }
  }
  PetscFunctionReturn(0);
}

/*
   H and Phi of one subdomain; K_CC stands in H already. `inverse`, K_rr^-1 or NULL, becomes K_rr^-1 - V_m T^-1 V_m^t: the
   displacements for unit forces while the coarse displacements are zero.
*/
static PetscErrorCode LatinHomogeniseSubdomain_Private(LatinLinear *linear, PetscInt s, PetscScalar T[], PetscScalar N[], PetscScalar TN[], PetscScalar work[], PetscScalar inverse[], PetscBool *singular)
{
  const PetscInt    bs = linear->sub->bs, m = linear->coarse->offset[s + 1] - linear->coarse->offset[s];
  const PetscInt    macros = linear->coarse->macro_count[s], primals = m - macros;
  PetscScalar      *H = linear->stiffness.H + linear->stiffness.h_offset[s], *phi = linear->Phi + linear->phi_offset[s];
  const PetscScalar one = 1.0, zero = 0.0, minus = -1.0;
  PetscBLASInt      bm, bp, bl, br, info = 0;
  size_t            rows;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(macros, &bm));
  PetscCall(PetscBLASIntCast(primals, &bp));
  PetscCall(PetscBLASIntCast(m, &bl));
  PetscCall(PetscBLASIntCast(bs * (linear->sub->node_offset[s + 1] - linear->sub->node_offset[s]), &br));
  rows = (size_t)br;
  PetscCall(PetscArrayzero(T, macros * macros));
  PetscCall(PetscArrayzero(N, macros * primals));
  PetscCall(LatinHomogeniseMacro_Private(linear, s, phi, T, N));
  /* - K_Cr V_C */
  for (PetscInt p = linear->rc_first[s]; p < linear->rc_last[s]; p++)
    for (PetscInt j = 0; j < primals; j++) H[macros + linear->rc[p].primal + m * (macros + j)] -= linear->rc[p].value * phi[(size_t)linear->rc[p].row + rows * (size_t)(macros + j)];
  for (size_t i = rows * (size_t)macros; i < rows * (size_t)m; i++) phi[i] = -phi[i];
  if (macros) {
    PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &bm, T, &bm, &info));
    *singular = (PetscBool)(info != 0);
    if (info) PetscFunctionReturn(0);
    PetscCallBLAS("LAPACKpotri", LAPACKpotri_("L", &bm, T, &bm, &info));
    for (PetscInt j = 0; j < macros; j++)
      for (PetscInt i = 0; i < j; i++) T[i + macros * j] = T[j + macros * i];
    for (PetscInt j = 0; j < macros; j++)
      for (PetscInt i = 0; i < macros; i++) H[i + m * j] = T[i + macros * j] - (i == j ? 1.0 : 0.0);
    if (primals) {
      PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &bm, &bp, &bm, &one, T, &bm, N, &bm, &zero, TN, &bm));
      for (PetscInt j = 0; j < primals; j++)
        for (PetscInt i = 0; i < macros; i++) H[i + m * (macros + j)] = H[macros + j + m * i] = -TN[i + macros * j];
      PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &bp, &bp, &bm, &one, N, &bm, TN, &bm, &one, H + macros + m * macros, &bl));
      PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &br, &bp, &bm, &minus, phi, &br, TN, &bm, &one, phi + rows * (size_t)macros, &br));
    }
    PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &br, &bm, &bm, &one, phi, &br, T, &bm, &zero, work, &br));
    if (inverse) PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &br, &br, &bm, &minus, work, &br, phi, &br, &one, inverse, &br));
    PetscCall(PetscArraycpy(phi, work, rows * (size_t)macros));
    PetscCall(PetscLogFlops((PetscLogDouble)macros * (macros * (macros + 2.0 * primals) + 2.0 * primals * primals + 2.0 * br * (primals + macros + (inverse ? br : 0)))));
  }
  for (PetscInt p = linear->inter->primal_offset[s]; p < linear->inter->primal_offset[s + 1]; p++) phi[(size_t)(linear->inter->primal_dof[p] - bs * linear->sub->node_offset[s]) + rows * (size_t)(macros + p - linear->inter->primal_offset[s])] = 1.0;
  /* symmetric to the bit, whatever the rounding above */
  for (PetscInt j = 0; j < m; j++)
    for (PetscInt i = 0; i < j; i++) H[i + m * j] = H[j + m * i] = 0.5 * (H[i + m * j] + H[j + m * i]);
  PetscFunctionReturn(0);
}

/*
   K_rr^-1 of a batch of many equal subdomains with neighbouring numbers, by the local solver: products with it, of many
   columns in place, are quicker than substitutions. Not where the solver is not direct, or rows are too many or members
   too few for the columns of the inverse to pay. Prescribed and primal rows and columns are zero.
*/
static PetscErrorCode LatinHomogeniseInverse_Private(LatinLinear *linear, PetscInt which, KSPConvergedReason *failed)
{
  const LatinBatch *batch = &linear->batches->batch[which];
  const PetscInt    n = batch->rows, first = linear->sub->bs * linear->sub->node_offset[batch->sub[0]];
  PetscInt          runs = 1;
  Mat               B, X;
  PetscScalar      *b;

  PetscFunctionBegin;
  for (PetscInt m = 1; m < batch->members; m++) runs += batch->sub[m] != batch->sub[m - 1] + 1 ? 1 : 0;
  if (!linear->solvers->direct || n > LATIN_INVERSE_ROWS || batch->members < LATIN_INVERSE_RUN * runs || batch->members * LATIN_INVERSE_STAGES < n) PetscFunctionReturn(0);
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

PetscErrorCode LatinHomogeniseSetUp(LatinLinear *linear)
{
  const LatinSubdomains *sub    = linear->sub;
  const PetscInt         w      = linear->coarse->widest;
  KSPConvergedReason     failed = KSP_CONVERGED_ITERATING;
  PetscInt               rows = 0, bad = -1;
  PetscScalar           *T, *N, *TN, *work;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Condense, linear->sub->object, 0, 0, 0));
  PetscCall(PetscCalloc1(linear->batches->n, &linear->inverse));
  if (linear->substructures) {
    PetscCall(LatinSubstructuresStiffness(linear));
    PetscCall(PetscLogEventEnd(LATIN_Condense, linear->sub->object, 0, 0, 0));
    PetscFunctionReturn(0);
  }
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    PetscCall(LatinHomogeniseSolve_Private(linear, b, &failed));
    PetscCall(LatinHomogeniseInverse_Private(linear, b, &failed));
  }
  LatinAgree(PetscObjectComm(linear->sub->object), failed, PETSC_ERR_CONV_FAILED, "A local solver gave up while the subdomains were condensed (%s); change its options, which start with -%slocal_", KSPConvergedReasons[failed],
             LatinPrefix(linear->sub));
  for (PetscInt s = 0; s < sub->n; s++) rows = PetscMax(rows, linear->sub->bs * (sub->node_offset[s + 1] - sub->node_offset[s]));
  PetscCall(PetscMalloc4(w * w, &T, w * w, &N, w * w, &TN, rows * w, &work));
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const PetscInt s        = linear->batches->batch[b].sub[0];
    PetscBool      singular = PETSC_FALSE;

    PetscCall(LatinHomogeniseSubdomain_Private(linear, s, T, N, TN, work, linear->inverse[b], &singular));
    if (singular && (bad < 0 || s < bad)) bad = s;
  }
  PetscCall(PetscFree4(T, N, TN, work));
  PetscCall(PetscLogEventEnd(LATIN_Condense, linear->sub->object, 0, 0, 0));
  LatinAgree(PetscObjectComm(linear->sub->object), bad >= 0, PETSC_ERR_PLIB, "The macro constraints of subdomain %" PetscInt_FMT " are dependent to rounding; change the partition, or try variant none", sub->first + bad);
  PetscFunctionReturn(0);
}
