#include "latinimpl.h"

/*
   Linear stage: the fixed operators K_E = B^t l B + C^t d C of the subdomains (28), with l = k, and one solve of the
   whole stage (42)-(52) for given forces.
*/

/*
   The rows of one batch's matrix. One pass counts, the next fills: rows on free dofs that are not primal, their
   coupling with the primal dofs, and the primal block, which starts the homogenised stiffness H.
*/
static PetscErrorCode LatinLinearRows_Private(Latin latin, LatinGraph *graph, const LatinBatch *batch, PetscInt ci[], PetscInt cj[], PetscReal ca[], PetscInt *couplings)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  const PetscBool    fill   = (PetscBool)(cj != NULL);
  const PetscInt     bs     = latin->sub.bs;
  PetscInt           nz = 0, rc = *couplings, n = 0;

  PetscFunctionBegin;
  for (PetscInt p = 0; p < batch->patterns; p++) {
    const PetscInt s = batch->sub[p], m = latin->coarse.offset[s + 1] - latin->coarse.offset[s], macros = latin->coarse.macro_count[s];
    const PetscInt top = bs * sub->node_offset[s], shift = batch->row[p] - top;
    PetscReal     *H = linear->H + linear->h_offset[s];

    linear->rc_first[s] = rc;
    for (PetscInt i = sub->node_offset[s]; i < sub->node_offset[s + 1]; i++) {
      PetscCall(LatinGraphRow_Private(latin, graph, i, linear->spring, &n));
      for (PetscInt c = 0; c < bs; c++) {
        const PetscInt row = bs * i + c, primal = linear->primal_index[row];

        ci[row + shift] = nz;
        if (sub->fixed[row] || primal >= 0) {
          if (fill) {
            cj[nz] = row + shift;
            ca[nz] = 1.0;
          }
          nz++;
          if (sub->fixed[row] || !fill) continue;
        }
        for (PetscInt q = 0; q < n; q++)
          for (PetscInt b = 0; b < bs; b++) {
            const PetscInt  col   = bs * graph->neighbour[q] + b;
            const PetscReal value = graph->block[bs * bs * q + c * bs + b];

            if (sub->fixed[col] || (value == 0.0 && row != col)) continue;
            if (primal >= 0) {
              if (linear->primal_index[col] >= 0) H[macros + primal + m * (macros + linear->primal_index[col])] += value;
            } else if (linear->primal_index[col] >= 0) {
              if (fill) {
                linear->rc_row[rc]   = row - top;
                linear->rc_col[rc]   = linear->primal_index[col];
                linear->rc_value[rc] = value;
              }
              rc++;
            } else {
              if (fill) {
                cj[nz] = col + shift;
                ca[nz] = value;
              }
              nz++;
            }
          }
      }
    }
    linear->rc_last[s] = rc;
  }
  ci[batch->row[batch->patterns]] = nz;
  *couplings                      = rc;
  PetscFunctionReturn(0);
}

/* Room for H and Phi: once for each pattern */
static PetscErrorCode LatinLinearOffsets_Private(Latin latin)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  size_t             h = 0, phi = 0;

  PetscFunctionBegin;
  PetscCall(PetscMalloc4(sub->n, &linear->rc_first, sub->n, &linear->rc_last, sub->n, &linear->h_offset, sub->n, &linear->phi_offset));
  for (PetscInt s = 0; s < sub->n; s++) {
    const size_t   m = (size_t)(latin->coarse.offset[s + 1] - latin->coarse.offset[s]), rows = (size_t)(latin->sub.bs * (sub->node_offset[s + 1] - sub->node_offset[s]));
    const PetscInt r = linear->blocks.pattern[s];

    linear->h_offset[s]   = r == s ? h : linear->h_offset[r];
    linear->phi_offset[s] = r == s ? phi : linear->phi_offset[r];
    if (r != s) continue;
    h += m * m;
    phi += m * rows;
  }
  PetscCall(PetscCalloc1(h, &linear->H));
  PetscCall(PetscMalloc1(phi, &linear->Phi));
  PetscFunctionReturn(0);
}

/* Work space for equal subdomains that are treated together */
static PetscErrorCode LatinLinearWork_Private(Latin latin)
{
  LatinInterfaces *inter = &latin->inter;
  PetscInt         tile = 0, sides = 0;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < latin->linear.blocks.n; b++) {
    const LatinBatch *batch = &latin->linear.blocks.batch[b];

    if (batch->members >= LATIN_LANES) tile = PetscMax(tile, batch->row[1]);
    for (PetscInt p = 0; p < batch->patterns; p++)
      for (PetscInt f = inter->offset[batch->sub[p]]; f < inter->offset[batch->sub[p] + 1]; f++) sides = PetscMax(sides, PetscMin(batch->members, LATIN_BLOCK_COLUMNS) * (inter->interface[f].side_last - inter->interface[f].side_first));
  }
  PetscCall(PetscMalloc1(2 * LATIN_LANES * tile, &latin->linear.tile));
  PetscCall(PetscMalloc1(2 * sides, &latin->direction_work));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLinearSetUp(Latin latin)
{
  LatinSubstructure *sub       = &latin->sub;
  LatinLinear       *linear    = &latin->linear;
  LatinBlockSolver  *solver    = &linear->solver;
  const PetscInt     n         = latin->sub.bs * sub->copies;
  PetscInt           couplings = 0;
  LatinGraph         graph;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Linear, latin, 0, 0, 0));
  PetscCall(LatinBlocksSetUp(latin));
  PetscCall(LatinMacroDual_Private(latin));
  PetscCall(LatinLinearOffsets_Private(latin));
  PetscCall(PetscMalloc6(n, &linear->g, n, &linear->U, latin->inter.sides, &linear->pull, n, &linear->load, linear->widest, &linear->lambda, n, &linear->spring));
  PetscCall(LatinLinearWork_Private(latin));
  PetscCall(LatinDirectionSprings_Private(latin, linear->spring));
  PetscCall(LatinGraphCreate_Private(latin, PETSC_TRUE, &graph));
  PetscCall(LatinBlockSolverCreate(latin, solver));
  for (PetscInt b = 0; b < linear->blocks.n; b++) {
    const LatinBatch *batch = &linear->blocks.batch[b];

    PetscCall(PetscMalloc1(batch->row[batch->patterns] + 1, &solver->ci[b]));
    PetscCall(LatinLinearRows_Private(latin, &graph, batch, solver->ci[b], NULL, NULL, &couplings));
    PetscCall(PetscMalloc1(solver->ci[b][batch->row[batch->patterns]], &solver->cj[b]));
    PetscCall(PetscMalloc1(solver->ci[b][batch->row[batch->patterns]], &solver->ca[b]));
  }
  PetscCall(PetscMalloc3(couplings, &linear->rc_row, couplings, &linear->rc_col, couplings, &linear->rc_value));
  couplings = 0;
  for (PetscInt b = 0; b < linear->blocks.n; b++) PetscCall(LatinLinearRows_Private(latin, &graph, &linear->blocks.batch[b], solver->ci[b], solver->cj[b], solver->ca[b], &couplings));
  PetscCall(LatinGraphDestroy_Private(&graph));
  for (PetscInt s = 0; s < sub->n; s++) {
    linear->rc_first[s] = linear->rc_first[linear->blocks.pattern[s]];
    linear->rc_last[s]  = linear->rc_last[linear->blocks.pattern[s]];
  }
  PetscCall(LatinBlockSolverSetUp(latin, solver, "local"));
  PetscCall(PetscLogEventEnd(LATIN_Linear, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* The loads, shared among the copies of a node */
PetscErrorCode LatinLinearSetLoads(Latin latin, Vec load)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  const PetscInt     bs     = latin->sub.bs;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(linear->load, bs * sub->copies));
  PetscCall(LatinDistribute_Private(latin, load, linear->load));
  for (PetscInt i = 0; i < bs * sub->copies; i++) linear->load[i] /= sub->multiplicity[i / bs];
  PetscFunctionReturn(0);
}

/* Forces on the coarse dofs of the subdomains of a batch: q = Phi^t g */
static PetscErrorCode LatinLinearCondense_Private(Latin latin, const LatinBatch *batch)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  LatinCoarse       *coarse = &latin->coarse;
  const PetscScalar  one = 1.0, zero = 0.0;
  PetscBLASInt       rows, cols, run, inc = 1;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < batch->patterns * batch->members; m += (PetscInt)run) {
    const PetscInt   s   = batch->sub[m];
    const PetscReal *Phi = linear->Phi + linear->phi_offset[s], *g = linear->g + sub->bs * sub->node_offset[s];
    PetscReal       *q = coarse->q + coarse->offset[s];

    PetscCall(PetscBLASIntCast(LatinBatchRun(batch, m), &run));
    PetscCall(PetscBLASIntCast(sub->bs * (sub->node_offset[s + 1] - sub->node_offset[s]), &rows));
    PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
    if (!cols) continue;
    if (run == 1) PetscCallBLAS("BLASgemv", BLASgemv_("T", &rows, &cols, &one, Phi, &rows, g, &inc, &zero, q, &inc));
    else PetscCallBLAS("BLASgemm", BLASgemm_("T", "N", &cols, &run, &rows, &one, Phi, &rows, g, &rows, &zero, q, &cols));
  }
  PetscFunctionReturn(0);
}

/* Adds to the forces of one subdomain what its coarse displacements cause: macro forces lambda, and primal displacements */
static PetscErrorCode LatinLinearRelocalise_Private(Latin latin, PetscInt s)
{
  LatinSubstructure *sub    = &latin->sub;
  LatinInterfaces   *inter  = &latin->inter;
  LatinLinear       *linear = &latin->linear;
  LatinCoarse       *coarse = &latin->coarse;
  const PetscReal   *u = coarse->u + coarse->offset[s], *q = coarse->q + coarse->offset[s], *uc = u + coarse->macro_count[s];
  PetscReal         *g = linear->g + latin->sub.bs * sub->node_offset[s], *lambda = linear->lambda;
  const PetscScalar  one = 1.0, zero = 0.0;
  const PetscBLASInt inc = 1;
  PetscBLASInt       macros, cols;

  PetscFunctionBegin;
  PetscCall(PetscBLASIntCast(coarse->macro_count[s], &macros));
  PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
  if (macros) {
    /* the first rows of H are (T^-1 - 1, -T^-1 N) */
    PetscCallBLAS("BLASgemv", BLASgemv_("N", &macros, &cols, &one, linear->H + linear->h_offset[s], &cols, u, &inc, &zero, lambda, &inc));
    for (PetscInt i = 0; i < macros; i++) lambda[i] += u[i] - q[i];
    for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
      const LatinInterface *face = &inter->interface[f];
      const PetscReal      *lf   = lambda + face->local_first - coarse->offset[s];

      for (PetscInt k = face->side_first; k < face->side_last; k++) {
        const PetscReal *row   = LatinMacroDualRow(&latin->macro, face, k);
        PetscReal        force = 0.0;

        for (PetscInt j = 0; j < face->modes; j++) force += row[j] * lf[j];
        linear->g[inter->side_dof[k]] += force;
      }
    }
  }
  for (PetscInt p = linear->rc_first[s]; p < linear->rc_last[s]; p++) g[linear->rc_row[p]] -= linear->rc_value[p] * uc[linear->rc_col[p]];
  for (PetscInt p = linear->primal_offset[s]; p < linear->primal_offset[s + 1]; p++) linear->g[linear->primal_dof[p]] = uc[p - linear->primal_offset[s]];
  PetscFunctionReturn(0);
}

/* Relocalisation and local solves in one, with a dense inverse: U += inverse g + Phi u */
static PetscErrorCode LatinLinearDense_Private(Latin latin, const LatinBatch *batch, const PetscReal inverse[], PetscReal U[])
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  LatinCoarse       *coarse = &latin->coarse;
  const PetscScalar  one    = 1.0;
  PetscBLASInt       rows, cols, run;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < batch->members; m += (PetscInt)run) {
    const PetscInt s = batch->sub[m], first = sub->bs * sub->node_offset[s];

    PetscCall(PetscBLASIntCast(LatinBatchRun(batch, m), &run));
    PetscCall(PetscBLASIntCast(batch->row[1], &rows));
    PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
    PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &rows, &run, &rows, &one, inverse, &rows, linear->g + first, &rows, &one, U + first, &rows));
    if (cols) PetscCallBLAS("BLASgemm", BLASgemm_("N", "N", &rows, &run, &cols, &one, linear->Phi + linear->phi_offset[s], &rows, coarse->u + coarse->offset[s], &cols, &one, U + first, &rows));
  }
  PetscFunctionReturn(0);
}

/* The same by the solver of the batch, in place of the forces */
static PetscErrorCode LatinLinearSolve_Private(Latin latin, PetscInt which, PetscReal U[])
{
  LatinSubstructure *sub    = &latin->sub;
  LatinLinear       *linear = &latin->linear;
  const LatinBatch  *batch  = &linear->blocks.batch[which];
  const PetscInt     n      = batch->patterns * batch->members;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < n; m++) {
    PetscCall(LatinLinearRelocalise_Private(latin, batch->sub[m]));
    /* identity rows: prescribed and primal displacements pass through */
    for (PetscInt i = sub->bs * sub->node_offset[batch->sub[m]]; i < sub->bs * sub->node_offset[batch->sub[m] + 1]; i++)
      if (sub->fixed[i]) linear->g[i] = 0.0;
  }
  PetscCall(LatinBlockSolveBatch_Private(latin, &linear->solver, which, linear->g, linear->g));
  for (PetscInt m = 0; m < n; m++)
    for (PetscInt i = sub->bs * sub->node_offset[batch->sub[m]]; i < sub->bs * sub->node_offset[batch->sub[m] + 1]; i++) U[i] += linear->g[i];
  PetscFunctionReturn(0);
}

/*
   The linear stage for the forces g, which it overwrites: adds to U the displacements of all copies, zero where they are
   prescribed; coarse.u are the coarse displacements. In order: condensed forces, coarse problem (52), relocalisation
   (42) with the macro forces lambda on the strong interfaces.
*/
PetscErrorCode LatinLinearApply(Latin latin, PetscReal U[])
{
  LatinLinear *linear = &latin->linear;

  PetscFunctionBegin;
  PetscCall(PetscLogEventBegin(LATIN_Condense, latin, 0, 0, 0));
  for (PetscInt b = 0; b < linear->blocks.n; b++) PetscCall(LatinLinearCondense_Private(latin, &linear->blocks.batch[b]));
  PetscCall(PetscLogEventEnd(LATIN_Condense, latin, 0, 0, 0));
  PetscCall(LatinCoarseSolve(latin));
  PetscCall(PetscLogEventBegin(LATIN_Linear, latin, 0, 0, 0));
  for (PetscInt b = 0; b < linear->blocks.n; b++) {
    if (!linear->solver.direct) PetscCall(LatinInexactSolve_Private(latin, b, U));
    else if (linear->inverse[b]) PetscCall(LatinLinearDense_Private(latin, &linear->blocks.batch[b], linear->inverse[b], U));
    else PetscCall(LatinLinearSolve_Private(latin, b, U));
  }
  PetscCall(PetscLogEventEnd(LATIN_Linear, latin, 0, 0, 0));
  PetscFunctionReturn(0);
}

PetscErrorCode LatinLinearReset(Latin latin)
{
  LatinLinear *linear = &latin->linear;

  PetscFunctionBegin;
  for (PetscInt b = 0; b < linear->blocks.n && linear->inverse; b++) PetscCall(PetscFree(linear->inverse[b]));
  PetscCall(PetscFree(linear->inverse));
  PetscCall(LatinBlockSolverDestroy(&linear->solver));
  PetscCall(LatinBlocksReset(latin));
  PetscCall(PetscFree3(linear->rc_row, linear->rc_col, linear->rc_value));
  PetscCall(PetscFree4(linear->rc_first, linear->rc_last, linear->h_offset, linear->phi_offset));
  PetscCall(PetscFree(linear->primal_offset));
  PetscCall(PetscFree(linear->primal_dof));
  PetscCall(PetscFree(linear->primal_index));
  PetscCall(PetscFree(linear->H));
  PetscCall(PetscFree(linear->Phi));
  PetscCall(PetscFree(linear->tile));
  PetscCall(PetscFree(latin->direction_work));
  PetscCall(PetscFree6(linear->g, linear->U, linear->pull, linear->load, linear->lambda, linear->spring));
  PetscCall(PetscMemzero(linear, sizeof(*linear)));
  PetscFunctionReturn(0);
}
