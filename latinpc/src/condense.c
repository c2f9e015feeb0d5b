#include "latinimpl.h"

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

#define LATIN_CONDENSE_COLUMNS 16 /* right-hand sides solved together: bounds the work space to that many copies of U */

#define LATIN_INVERSE_ROWS   512 /* largest dense inverse */
#define LATIN_INVERSE_RUN    8   /* fewest subdomains of neighbouring numbers, on average */
#define LATIN_INVERSE_STAGES 8   /* the columns of an inverse are no more than the right-hand sides of so many linear stages */

/* Columns first..last of [A_r^t, K_rC] for all patterns of a batch at once: its matrix is block diagonal */
static PetscErrorCode LatinCondenseColumns_Private(Latin latin, const LatinBatch *batch, PetscInt first, PetscInt last, PetscScalar b[])
{
  LatinInterfaces *inter  = &latin->inter;
  LatinLinear     *linear = &latin->linear;
  const size_t     n      = (size_t)batch->row[batch->patterns];

  PetscFunctionBegin;
  PetscCall(PetscMemzero(b, n * (size_t)(last - first) * sizeof(*b)));
  for (PetscInt p = 0; p < batch->patterns; p++) {
    const PetscInt s = batch->sub[p], macros = latin->coarse.macro_count[s], shift = batch->row[p] - latin->sub.bs * latin->sub.node_offset[s];

    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscInt        at   = face->local_first - latin->coarse.offset[s];

      for (PetscInt j = PetscMax(first, at); j < PetscMin(last, at + face->modes); j++) {
        for (PetscInt k = face->side_first; k < face->side_last; k++)
          if (linear->primal_index[inter->side_dof[k]] < 0) b[(size_t)(inter->side_dof[k] + shift) + n * (size_t)(j - first)] += LatinMacroDualRow(&latin->macro, face, k)[j - at];
      }
    }
    for (PetscInt c = linear->rc_first[s]; c < linear->rc_last[s]; c++) {
      const PetscInt j = macros + linear->rc_col[c];

      if (j >= first && j < last) b[(size_t)(linear->rc_row[c] + batch->row[p]) + n * (size_t)(j - first)] += linear->rc_value[c];
    }
  }
  PetscFunctionReturn(0);
}

/* Phi first holds [V_m, V_C] */
static PetscErrorCode LatinCondenseSolve_Private(Latin latin, PetscInt which, KSPConvergedReason *failed)
{
  LatinLinear      *linear = &latin->linear;
  const LatinBatch *batch  = &linear->blocks.batch[which];
  const PetscInt    n      = batch->row[batch->patterns];
  PetscInt          widest = 0;
  KSP               ksp    = linear->solver.ksp[which];

  PetscFunctionBegin;
  if (linear->solver.direct) PetscCall(PetscObjectReference((PetscObject)ksp));
  else PetscCall(LatinSolverAccurate_Private(latin, linear->solver.ksp[which], &ksp));
  for (PetscInt p = 0; p < batch->patterns; p++) widest = PetscMax(widest, latin->coarse.offset[batch->sub[p] + 1] - latin->coarse.offset[batch->sub[p]]);
  for (PetscInt first = 0; first < widest; first += LATIN_CONDENSE_COLUMNS) {
    const PetscInt     last = PetscMin(first + LATIN_CONDENSE_COLUMNS, widest);
    Mat                B, X;
    PetscScalar       *b;
    const PetscScalar *x;

    PetscCall(LatinDenseCreate_Private(n, last - first, &B));
    PetscCall(LatinDenseCreate_Private(n, last - first, &X));
    PetscCall(MatDenseGetArrayWrite(B, &b));
    PetscCall(LatinCondenseColumns_Private(latin, batch, first, last, b));
    PetscCall(MatDenseRestoreArrayWrite(B, &b));
    PetscCall(LatinDenseSolve_Private(ksp, B, X, failed));
    PetscCall(MatDenseGetArrayRead(X, &x));
    for (PetscInt p = 0; p < batch->patterns; p++) {
      const PetscInt s    = batch->sub[p];
      const size_t   rows = (size_t)(batch->row[p + 1] - batch->row[p]);

      for (PetscInt j = first; j < PetscMin(last, latin->coarse.offset[s + 1] - latin->coarse.offset[s]); j++)
        PetscCall(PetscMemcpy(linear->Phi + linear->phi_offset[s] + rows * (size_t)j, x + batch->row[p] + (size_t)n * (size_t)(j - first), rows * sizeof(*x)));
    }
    PetscCall(MatDenseRestoreArrayRead(X, &x));
    PetscCall(MatDestroy(&B));
    PetscCall(MatDestroy(&X));
  }
  PetscCall(KSPDestroy(&ksp));
  PetscFunctionReturn(0);
}

/* T (macros x macros) and N (macros x primals) of one subdomain, from [V_m, V_C] in phi */
static PetscErrorCode LatinCondenseMacro_Private(Latin latin, PetscInt s, const PetscScalar phi[], PetscScalar T[], PetscScalar N[])
{
  LatinInterfaces *inter  = &latin->inter;
  LatinLinear     *linear = &latin->linear;
  const PetscInt   bs = latin->sub.bs, top = bs * latin->sub.node_offset[s];
  const PetscInt   macros = latin->coarse.macro_count[s], columns = latin->coarse.offset[s + 1] - latin->coarse.offset[s];
  const size_t     rows = (size_t)(bs * (latin->sub.node_offset[s + 1] - latin->sub.node_offset[s]));

  PetscFunctionBegin;
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        at   = face->local_first - latin->coarse.offset[s];

    for (PetscInt i = 0; i < face->modes; i++) {
      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        const PetscInt  dof = inter->side_dof[k], primal = linear->primal_index[dof];
        const PetscReal a = LatinMacroDualRow(&latin->macro, face, k)[i];

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
static PetscErrorCode LatinCondenseSubdomain_Private(Latin latin, PetscInt s, PetscScalar T[], PetscScalar N[], PetscScalar TN[], PetscScalar work[], PetscScalar inverse[], PetscBool *singular)
{
  LatinLinear      *linear = &latin->linear;
  const PetscInt    bs = latin->sub.bs, m = latin->coarse.offset[s + 1] - latin->coarse.offset[s];
  const PetscInt    macros = latin->coarse.macro_count[s], primals = m - macros;
  PetscScalar      *H = linear->H + linear->h_offset[s], *phi = linear->Phi + linear->phi_offset[s];
  const PetscScalar one = 1.0, zero = 0.0, minus = -1.0;
  PetscBLASInt      bm, bp, bl, br, info = 0;
  size_t            rows;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(macros, &bm));
  PetscCall(PetscBLASIntCast(primals, &bp));
  PetscCall(PetscBLASIntCast(m, &bl));
  PetscCall(PetscBLASIntCast(bs * (latin->sub.node_offset[s + 1] - latin->sub.node_offset[s]), &br));
  rows = (size_t)br;
  PetscCall(PetscArrayzero(T, macros * macros));
  PetscCall(PetscArrayzero(N, macros * primals));
  PetscCall(LatinCondenseMacro_Private(latin, s, phi, T, N));
  /* - K_Cr V_C */
  for (PetscInt p = linear->rc_first[s]; p < linear->rc_last[s]; p++)
    for (PetscInt j = 0; j < primals; j++) H[macros + linear->rc_col[p] + m * (macros + j)] -= linear->rc_value[p] * phi[(size_t)linear->rc_row[p] + rows * (size_t)(macros + j)];
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
  }
  for (PetscInt p = latin->linear.primal_offset[s]; p < latin->linear.primal_offset[s + 1]; p++) phi[(size_t)(linear->primal_dof[p] - bs * latin->sub.node_offset[s]) + rows * (size_t)(macros + p - linear->primal_offset[s])] = 1.0;
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
static PetscErrorCode LatinCondenseInverse_Private(Latin latin, PetscInt which, KSPConvergedReason *failed)
{
  LatinLinear       *linear = &latin->linear;
  const LatinBatch  *batch  = &linear->blocks.batch[which];
  const PetscInt     n = batch->row[batch->patterns], first = latin->sub.bs * latin->sub.node_offset[batch->sub[0]];
  PetscInt           runs = 1;
  Mat                B, X;
  PetscScalar       *b;
  const PetscScalar *x;

  PetscFunctionBegin;
  for (PetscInt m = 1; m < batch->members; m++) runs += batch->sub[m] != batch->sub[m - 1] + 1 ? 1 : 0;
  if (!linear->solver.direct || batch->patterns > 1 || n > LATIN_INVERSE_ROWS || batch->members < LATIN_INVERSE_RUN * runs || batch->members * LATIN_INVERSE_STAGES < n) PetscFunctionReturn(0);
  PetscCall(LatinDenseCreate_Private(n, n, &B));
  PetscCall(LatinDenseCreate_Private(n, n, &X));
  PetscCall(MatDenseGetArrayWrite(B, &b));
  PetscCall(PetscArrayzero(b, n * n));
  for (PetscInt i = 0; i < n; i++) b[i + n * i] = latin->sub.fixed[first + i] || linear->primal_index[first + i] >= 0 ? 0.0 : 1.0;
  PetscCall(MatDenseRestoreArrayWrite(B, &b));
  PetscCall(LatinDenseSolve_Private(linear->solver.ksp[which], B, X, failed));
  PetscCall(PetscMalloc1(n * n, &linear->inverse[which]));
  PetscCall(MatDenseGetArrayRead(X, &x));
  PetscCall(PetscArraycpy(linear->inverse[which], x, n * n));
  PetscCall(MatDenseRestoreArrayRead(X, &x));
  PetscCall(MatDestroy(&B));
  PetscCall(MatDestroy(&X));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinCondenseSetUp(Latin latin)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  const PetscInt     w      = linear->widest;
  KSPConvergedReason failed = KSP_CONVERGED_ITERATING;
  PetscInt           rows = 0, bad = -1;
  PetscScalar       *T, *N, *TN, *work;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Condense, latin, 0, 0, 0));
  PetscCall(PetscCalloc1(linear->blocks.n, &linear->inverse));
  for (PetscInt b = 0; b < linear->blocks.n; b++) {
    PetscCall(LatinCondenseSolve_Private(latin, b, &failed));
    PetscCall(LatinCondenseInverse_Private(latin, b, &failed));
  }
  LatinAgree(PetscObjectComm((PetscObject)latin), failed, PETSC_ERR_CONV_FAILED, "A local solver gave up while the subdomains were condensed (%s); change its options, which start with -%slocal_", KSPConvergedReasons[failed],
             ((PetscObject)latin)->prefix ? ((PetscObject)latin)->prefix : "");
  for (PetscInt s = 0; s < sub->n; s++) rows = PetscMax(rows, latin->sub.bs * (sub->node_offset[s + 1] - sub->node_offset[s]));
  PetscCall(PetscMalloc4(w * w, &T, w * w, &N, w * w, &TN, rows * w, &work));
  for (PetscInt b = 0; b < linear->blocks.n; b++)
    for (PetscInt p = 0; p < linear->blocks.batch[b].patterns; p++) {
      const PetscInt s        = linear->blocks.batch[b].sub[p];
      PetscBool      singular = PETSC_FALSE;

      PetscCall(LatinCondenseSubdomain_Private(latin, s, T, N, TN, work, linear->inverse[b], &singular));
      if (singular && (bad < 0 || s < bad)) bad = s;
    }
  PetscCall(PetscFree4(T, N, TN, work));
  PetscCall(PetscLogEventEnd(LATIN_Condense, latin, 0, 0, 0));
  LatinAgree(PetscObjectComm((PetscObject)latin), bad >= 0, PETSC_ERR_PLIB, "The macro constraints of subdomain %" PetscInt_FMT " are dependent to rounding; change the partition, or try variant none", sub->first + bad);
  PetscFunctionReturn(0);
}
