#include "stages/latinstages.h"
#include <petsctime.h>

/*
   Linear stage: the constant operators K_E = B^t l B + C^t d C of the subdomains (28), with l = k, and the solve (42)-(52) for given forces:

   1. Condensation of the forces on the coarse dofs, q = Phi^t g.
   2. The coarse problem (52).
   3. Relocalisation (42) and local solves.
*/

/*
   Splits the matrix K of subdomain s: K keeps K_rr, with the identity in primal rows; K_rC is appended to rc; K_CC is added to the homogenised
   stiffness H.
*/
static PetscErrorCode LatinLinearSplit_Private(LatinLinear *linear, PetscInt s, LatinSparse *K, PetscSegBuffer rc, PetscInt *couplings)
{
  const PetscInt  m = linear->coarse->offset[s + 1] - linear->coarse->offset[s], macros = linear->coarse->macro_count[s], top = linear->sub->bs * linear->sub->node_offset[s];
  const PetscInt *primal = linear->inter->primal_index + top;
  PetscReal      *H      = linear->stiffness.H + linear->stiffness.h_offset[s];
  PetscInt        nz     = 0;

  PetscFunctionBegin;
  linear->rc_first[s] = *couplings;
  for (PetscInt r = 0, first = 0; r < K->rows; r++) {
    const PetscBool apart = (PetscBool)(primal[r] >= 0 && !linear->sub->fixed[top + r]);
    const PetscInt  last  = K->i[r + 1];

    K->i[r] = nz;
    for (PetscInt k = first; k < last; k++) {
      const PetscInt  column = K->j[k], at = primal[column];
      const PetscReal value = K->a[k];

      if (apart && at >= 0) H[macros + primal[r] + m * (macros + at)] += value;
      if (column == r || (!apart && at < 0)) { /* identity in a primal row */
        K->j[nz]   = column;
        K->a[nz++] = apart ? 1.0 : value;
      } else if (!apart) {
        LatinCoupling *coupling;

        PetscCall(PetscSegBufferGet(rc, 1, &coupling));
        *coupling = (LatinCoupling){.row = r, .primal = at, .value = value};
        ++*couplings;
      }
    }
    first = last;
  }
  K->i[K->rows]      = nz;
  linear->rc_last[s] = *couplings;
  PetscFunctionReturn(0);
}

/* The same for a subdomain of a matrix without interior, whose inverse exists already: reads the entries directly. There are no springs on primal dofs */
static PetscErrorCode LatinLinearCouplings_Private(LatinLinear *linear, PetscInt s, PetscSegBuffer rc, PetscInt *couplings)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         m = linear->coarse->offset[s + 1] - linear->coarse->offset[s], macros = linear->coarse->macro_count[s], top = sub->node_offset[s];
  PetscReal             *H = linear->stiffness.H + linear->stiffness.h_offset[s];

  PetscFunctionBegin;
  linear->rc_first[s] = *couplings;
  for (PetscInt p = linear->inter->primal_offset[s]; p < linear->inter->primal_offset[s + 1]; p++) {
    const PetscInt row = linear->inter->primal_dof[p], primal = p - linear->inter->primal_offset[s];

    for (PetscInt k = sub->ki[row]; k < sub->ki[row + 1]; k++) {
      const PetscInt column = LatinEntryColumn(sub, row, k), at = linear->inter->primal_index[column];

      if (at >= 0) H[macros + primal + m * (macros + at)] += LatinEntry(sub, row, k);
      else {
        LatinCoupling *coupling;

        PetscCall(PetscSegBufferGet(rc, 1, &coupling));
        *coupling = (LatinCoupling){.row = column - top, .primal = primal, .value = LatinEntry(sub, row, k)};
        ++*couplings;
      }
    }
  }
  linear->rc_last[s] = *couplings;
  PetscFunctionReturn(0);
}

/* Takes the dense inverses of the local low-energy fields (interfaces/facemodes.c), one for each batch */
static PetscErrorCode LatinLinearInverses_Private(LatinLinear *linear)
{
  PetscFunctionBegin;
  PetscCall(PetscCalloc1(linear->batches->n, &linear->inverse));
  if (!linear->spectral->inverse) PetscFunctionReturn(0);
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const PetscInt s = linear->batches->batch[b].sub[0];

    linear->inverse[b]           = linear->spectral->inverse[s];
    linear->spectral->inverse[s] = NULL;
  }
  PetscCall(LatinSpectralFreeInverses(linear->spectral));
  PetscFunctionReturn(0);
}

/*
   Sets keeps[]: whether the factor of a batch keeps the primal rows and gives their Schur complement. All do that have no dense inverse, if only
   interface dofs are read and the local solver is the default
*/
static PetscErrorCode LatinLinearKeeps_Private(LatinLinear *linear)
{
  PetscBool keep = PETSC_FALSE;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(linear->batches->n, &linear->keeps));
  if (linear->shared && linear->inter->sides && !linear->substructures) PetscCall(LatinSolverIsDefault_Private(linear->sub->object, "local", &keep));
  for (PetscInt b = 0; b < linear->batches->n; b++) linear->keeps[b] = (PetscBool)(linear->substructures || (keep && !LatinHomogeniseInverts(linear, b)));
  PetscFunctionReturn(0);
}

/* Assembles the matrices of all batches, their couplings K_rC, and K_CC in H */
static PetscErrorCode LatinLinearMatrices_Private(LatinLinear *linear)
{
  const LatinBatches *batches   = linear->batches;
  PetscInt            couplings = 0;
  PetscSegBuffer      rc;

  PetscFunctionBegin;
  linear->released = PETSC_FALSE;
  PetscCall(PetscSegBufferCreate(sizeof(LatinCoupling), 1024, &rc));
  for (PetscInt b = 0; b < batches->n; b++) {
    const PetscInt s    = batches->batch[b].sub[0];
    LatinSparse   *K    = &linear->solvers->rows[b];
    PetscBool      done = PETSC_FALSE;

    if (linear->inverse[b]) {
      PetscCall(LatinLinearCouplings_Private(linear, s, rc, &couplings));
      continue;
    }
    if (!LatinDirectionBlocks(linear->dir, s)) PetscCall(LatinLocalSolversRenew_Private(linear->solvers, b, linear->spring, linear->sub->fixed, &done));
    if (!done) PetscCall(LatinDirectionMatrix(linear->dir, s, linear->spring, K));
    linear->rc_first[s] = linear->rc_last[s] = 0;
    if (!linear->keeps[b]) PetscCall(LatinLinearSplit_Private(linear, s, K, rc, &couplings));
  }
  PetscCall(PetscSegBufferExtractAlloc(rc, &linear->rc));
  PetscCall(PetscSegBufferDestroy(&rc));
  for (PetscInt s = 0; s < linear->sub->n; s++) {
    linear->rc_first[s] = linear->rc_first[batches->pattern[s]];
    linear->rc_last[s]  = linear->rc_last[batches->pattern[s]];
  }
  PetscFunctionReturn(0);
}

/* Allocates H, once for equal subdomains. H of substructures comes with the factor */
static PetscErrorCode LatinLinearOffsets_Private(LatinLinear *linear)
{
  const LatinSubdomains *sub = linear->sub;
  size_t                 h   = 0;

  PetscFunctionBegin;
  linear->stiffness.pattern = linear->batches->pattern;
  PetscCall(PetscMalloc3(sub->n, &linear->rc_first, sub->n, &linear->rc_last, sub->n, &linear->stiffness.h_offset));
  PetscCall(PetscCalloc1(sub->n, &linear->Phi));
  for (PetscInt s = 0; s < sub->n; s++) {
    const PetscInt r = linear->batches->pattern[s];

    linear->stiffness.h_offset[s] = r == s ? h : linear->stiffness.h_offset[r];
    if (r == s) h += PetscSqr((size_t)(linear->coarse->offset[s + 1] - linear->coarse->offset[s]));
  }
  linear->stiffness.once  = linear->substructures;
  linear->stiffness.lower = PETSC_FALSE;
  if (!linear->substructures) PetscCall(PetscCalloc1(h, &linear->stiffness.H));
  PetscFunctionReturn(0);
}

/* Allocates work space for blocks of equal subdomains */
static PetscErrorCode LatinLinearWork_Private(LatinLinear *linear)
{
  const LatinInterfaces *inter = linear->inter;
  PetscInt               sides = 0;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const LatinBatch *batch = &linear->batches->batch[b];

    for (PetscInt f = inter->offset[batch->sub[0]]; f < inter->offset[batch->sub[0] + 1]; f++) sides = PetscMax(sides, PetscMin(batch->members, LATIN_BATCH_COLUMNS) * (inter->interface[f].side_last - inter->interface[f].side_first));
  }
  PetscCall(PetscMalloc1(2 * sides, &linear->work));
  PetscFunctionReturn(0);
}

/* Sets up the operators of the subdomains and their solvers, from batches and macro bases. solvers->status reports failures */
PetscErrorCode LatinLinearSetUp(LatinLinear *linear)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         n = sub->bs * sub->copies, sides = linear->inter->sides;
  PetscBool              checked;

  PetscFunctionBegin;
  linear->solves  = 0;
  linear->seconds = 0.0;
  PetscCall(PetscLogEventBegin(LATIN_Linear, sub->object, 0, 0, 0));
  linear->substructures = PETSC_FALSE;
  if (linear->inter->variant == LATIN_VARIANT_PRIMAL) PetscCall(LatinSolverIsDefault_Private(sub->object, "local", &linear->substructures));
  PetscCall(LatinLinearOffsets_Private(linear));
  PetscCall(PetscMalloc1(n, &linear->spring));
  PetscCall(PetscMalloc1(sides, &linear->outgoing));
  PetscCall(PetscCalloc1(sub->unassigned_count, &linear->unassigned_u));
  if (sub->structure && sub->structure->rigid_law >= 0 && !sub->tangent) {
    PetscCall(PetscCalloc1(sub->nonsmooth, &linear->tension));
    PetscCall(PetscCalloc1(sub->structure->links_local + 1, &linear->rigid_tension)); /* + 1: NULL means that no link is rigid, on any rank */
  }
  if (sub->part) PetscCall(PetscCalloc1(sub->links + 1, &linear->strain)); /* + 1: never NULL */
  PetscCall(LatinLinearWork_Private(linear));
  PetscCall(LatinDirectionSprings_Private(linear->dir, linear->spring));
  PetscCall(LatinLocalSolversCreate(sub, linear->batches, linear->solvers));
  PetscCall(LatinLinearInverses_Private(linear));
  PetscCall(LatinLinearKeeps_Private(linear));
  PetscCall(LatinLinearMatrices_Private(linear));
  PetscCall(LatinSolverIsDefault_Private(sub->object, "coarse", &checked)); /* single precision needs a coarse factor, which detects a soft coarse problem */
  if (!linear->substructures) linear->solvers->precision = sub->preconditions && checked && !linear->precise ? LATIN_PRECISION_AUTO : LATIN_PRECISION_DOUBLE;
  linear->solvers->kept_offset = linear->inter->primal_offset;
  linear->solvers->kept        = linear->inter->primal_dof;
  linear->solvers->keeps       = linear->substructures ? NULL : linear->keeps;
  linear->solvers->callback    = LatinSubstructuresCallback(linear);
  PetscCall(LatinLocalSolversSetUp(linear->solvers, "local", PETSC_FALSE));
  /* allocated after the peak memory of the factorisations */
  PetscCall(PetscMalloc5(n, &linear->g, n, &linear->U, sides, &linear->pull, n, &linear->load, linear->coarse->widest, &linear->lambda));
  PetscCall(PetscLogEventEnd(LATIN_Linear, sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* Divides the loads equally among the copies of a node; solves for dofs in no subdomain. Collective on sub->object */
PetscErrorCode LatinLinearSetLoads(LatinLinear *linear, Vec load)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         bs  = linear->sub->bs;
  const PetscScalar     *a;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(linear->load, bs * sub->copies));
  PetscCall(LatinDistribute_Private(linear->sub, load, linear->load));
  for (PetscInt i = 0; i < bs * sub->copies; i++) linear->load[i] /= sub->multiplicity[i / bs];
  PetscCall(VecGetArrayRead(load, &a));
  for (PetscInt k = 0; k < sub->unassigned_count; k++) linear->unassigned_u[k] = sub->unassigned_inverse[k] * a[sub->unassigned[k]];
  PetscCall(VecRestoreArrayRead(load, &a));
  PetscFunctionReturn(0);
}

/* Computes the condensed forces of the subdomains of a batch, q = Phi^t g */
static PetscErrorCode LatinLinearCondense_Private(LatinLinear *linear, const LatinBatch *batch)
{
  const LatinSubdomains *sub    = linear->sub;
  LatinCoarse           *coarse = linear->coarse;
  const PetscScalar      one = 1.0, zero = 0.0;
  PetscBLASInt           rows, cols, run, inc = 1;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < batch->members; m += (PetscInt)run) {
    const PetscInt   s   = batch->sub[m];
    const LatinPhi  *Phi = &linear->Phi[s];
    const PetscReal *g   = linear->g + sub->bs * sub->node_offset[s];
    PetscReal       *q   = coarse->q + coarse->offset[s];

    PetscCall(PetscBLASIntCast(LatinBatchRun(batch, m), &run));
    PetscCall(PetscBLASIntCast(Phi->rows, &rows));
    PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
    if (!cols) continue;
    PetscCall(PetscLogFlops(2.0 * rows * cols * run));
    if (run == 1) PetscCallBLAS("BLASgemv", BLASgemv_("T", &rows, &cols, &one, Phi->a, &rows, g, &inc, &zero, q, &inc));
    else PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &cols, &run, &rows, &one, Phi->a, &rows, g, &rows, &zero, q, &cols));
  }
  PetscFunctionReturn(0);
}

/* Adds the displacements of a batch with a dense inverse to U: inverse g + Phi u, relocalisation and local solves */
static PetscErrorCode LatinLinearDense_Private(LatinLinear *linear, const LatinBatch *batch, const PetscReal inverse[], PetscReal U[])
{
  const LatinSubdomains *sub    = linear->sub;
  LatinCoarse           *coarse = linear->coarse;
  const PetscScalar      one    = 1.0;
  const PetscBLASInt     inc    = 1;
  PetscBLASInt           rows, cols, run;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < batch->members; m += (PetscInt)run) {
    const PetscInt s = batch->sub[m], first = sub->bs * sub->node_offset[s];

    PetscCall(PetscBLASIntCast(LatinBatchRun(batch, m), &run));
    PetscCall(PetscBLASIntCast(batch->rows, &rows));
    PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
    PetscCall(PetscLogFlops(2.0 * rows * run * ((PetscLogDouble)rows + cols)));
    if (run == 1) PetscCallBLAS("BLASsymv", LatinBLASsymv_("L", &rows, &one, inverse, &rows, linear->g + first, &inc, &one, U + first, &inc));
    else PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &rows, &run, &rows, &one, inverse, &rows, linear->g + first, &rows, &one, U + first, &rows));
    if (cols) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &rows, &run, &cols, &one, linear->Phi[s].a, &rows, coarse->u + coarse->offset[s], &cols, &one, U + first, &rows));
  }
  PetscFunctionReturn(0);
}

/* The same with the solver of the batch. Overwrites g */
static PetscErrorCode LatinLinearSolve_Private(LatinLinear *linear, PetscInt which, PetscReal U[])
{
  const LatinSubdomains *sub   = linear->sub;
  const LatinBatch      *batch = &linear->batches->batch[which];
  const PetscInt         n     = batch->members;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < n; m++) {
    PetscCall(LatinLinearRelocalise_Private(linear, batch->sub[m], PETSC_FALSE));
    /* K has identity rows for prescribed and primal dofs: their right-hand sides are their displacements */
    for (PetscInt i = sub->bs * sub->node_offset[batch->sub[m]]; i < sub->bs * sub->node_offset[batch->sub[m] + 1]; i++)
      if (sub->fixed[i]) linear->g[i] = 0.0;
  }
  PetscCall(LatinLocalSolve_Private(linear->solvers, which, linear->g, linear->g));
  for (PetscInt m = 0; m < n; m++)
    for (PetscInt i = sub->bs * sub->node_offset[batch->sub[m]]; i < sub->bs * sub->node_offset[batch->sub[m] + 1]; i++) U[i] += linear->g[i];
  PetscFunctionReturn(0);
}

/*
   Adds to U the displacements of the coarse displacements coarse->u and of the forces g (prolongation), after the condensation has set g and coarse->q.
   Overwrites g
*/
PetscErrorCode LatinLinearExpand(LatinLinear *linear, PetscReal U[])
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    if (linear->inverse[b]) PetscCall(LatinLinearDense_Private(linear, &linear->batches->batch[b], linear->inverse[b], U));
    else if (linear->keeps[b]) PetscCall(LatinSubstructuresBackward(linear, b, U));
    else PetscCall(LatinLinearSolve_Private(linear, b, U));
  }
  if (linear->substructures) linear->solve_error = (PetscSqr(linear->solvers->rounding) + PetscSqr(linear->coarse->contraction)) * linear->energy;
  PetscFunctionReturn(0);
}

/*
   Performs the linear stage: adds to U the displacements of all copies under the forces g, zero at prescribed dofs. Overwrites g and sets coarse->u. On
   strong interfaces relocalisation uses the macro forces lambda. Collective on sub->object
*/
PetscErrorCode LatinLinearApply(LatinLinear *linear, PetscReal U[])
{
  PetscLogDouble start, end;

  PetscFunctionBegin;
  PetscCall(LatinInterrupt_Private());
  PetscCall(PetscTime(&start));
  linear->solvers->failed = linear->coarse->failed = PETSC_FALSE;
  PetscCall(PetscLogEventBegin(LATIN_Condense, linear->sub->object, 0, 0, 0));
  linear->energy = 0.0;
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    if (linear->keeps[b]) PetscCall(LatinSubstructuresForward(linear, b));
    else PetscCall(LatinLinearCondense_Private(linear, &linear->batches->batch[b]));
  }
  PetscCall(PetscLogEventEnd(LATIN_Condense, linear->sub->object, 0, 0, 0));
  PetscCall(LatinCoarseSolve(linear->coarse, linear->corrected && linear->substructures ? LATIN_COARSE_CONTRACTION : 0.0));
  PetscCall(PetscLogEventBegin(LATIN_Linear, linear->sub->object, 0, 0, 0));
  PetscCall(LatinLinearExpand(linear, U));
  PetscCall(PetscLogEventEnd(LATIN_Linear, linear->sub->object, 0, 0, 0));
  if (linear->solvers->failed || linear->coarse->failed) linear->failed = PETSC_TRUE;
  PetscCall(PetscTime(&end));
  linear->seconds += end - start;
  linear->solves++;
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLinearReset(LatinLinear *linear)
{
  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->batches->n && linear->inverse; b++) PetscCall(PetscFree(linear->inverse[b]));
  PetscCall(PetscFree(linear->inverse));
  PetscCall(PetscFree(linear->rc));
  PetscCall(PetscFree3(linear->rc_first, linear->rc_last, linear->stiffness.h_offset));
  PetscCall(PetscFree(linear->stiffness.H));
  for (PetscInt b = 0; b < linear->batches->n && linear->Phi; b++) PetscCall(PetscFree2(linear->Phi[linear->batches->batch[b].sub[0]].row, linear->Phi[linear->batches->batch[b].sub[0]].a));
  PetscCall(PetscFree(linear->Phi));
  PetscCall(PetscFree(linear->some));
  PetscCall(PetscFree(linear->keeps));
  PetscCall(PetscFree(linear->work));
  PetscCall(PetscFree(linear->outgoing));
  PetscCall(PetscFree(linear->unassigned_u));
  PetscCall(PetscFree(linear->tension));
  PetscCall(PetscFree(linear->strain));
  PetscCall(PetscFree(linear->rigid_tension));
  PetscCall(PetscFree5(linear->g, linear->U, linear->pull, linear->load, linear->lambda));
  PetscCall(PetscFree(linear->spring));
  PetscFunctionReturn(0);
}
