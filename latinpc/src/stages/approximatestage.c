#include "stages/latinstages.h"

/*
   The linear stage with approximate solvers of the subdomains. What must not be approximate is the coarse space, or rigid
   motions of a subdomain would cost energy: H and Phi come from accurate solves, with what the options choose as
   preconditioner of conjugate gradients. In the linear stage itself one application B of it takes the place of K_rr^-1,
   between projections that keep the macro displacements at zero. With A_r and V_m = K_rr^-1 A_r^t as in
   stages/homogenise.c, and T = A_r V_m:

     U = P^t B P g + Phi u,   P = 1 - A_r^t T^-1 V_m^t

   P^t K_rr^-1 P is the exact operator K_rr^-1 - V_m T^-1 V_m^t; with B symmetric positive definite the linear stage
   remains so. P g takes the macro part of q = Phi^t g, and P^t y takes Phi times the macro displacements of y.
*/

/* Adds the macro forces -q to the forces of a subdomain: P g. Nothing acts where displacements are prescribed or primal */
static void LatinInexactBefore(LatinLinear *linear, PetscInt s)
{
  const LatinSubdomains *sub   = linear->sub;
  const LatinInterfaces *inter = linear->inter;
  const PetscReal       *q     = linear->coarse->q + linear->coarse->offset[s];

  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscReal      *qf   = q + linear->macro->of[f].at;

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscReal *row = LatinMacroDualRow(linear->macro, f, k);

      for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) linear->g[inter->side_dof[k]] -= row[j] * qf[j];
    }
  }
  for (PetscInt i = sub->bs * sub->node_offset[s]; i < sub->bs * sub->node_offset[s + 1]; i++)
    if (sub->fixed[i] || linear->inter->primal_index[i] >= 0) linear->g[i] = 0.0;
}

/* U += P^t y + Phi u for y in place of the forces: of the coarse displacements u, y's macro displacements are taken away. Uses q */
static PetscErrorCode LatinInexactAfter_Private(LatinLinear *linear, PetscInt s, PetscReal U[])
{
  const LatinSubdomains *sub    = linear->sub;
  const LatinInterfaces *inter  = linear->inter;
  LatinCoarse           *coarse = linear->coarse;
  const PetscInt         first = sub->bs * sub->node_offset[s], last = sub->bs * sub->node_offset[s + 1];
  const PetscScalar      one = 1.0;
  const PetscBLASInt     inc = 1;
  PetscReal             *u   = coarse->q + coarse->offset[s];
  PetscBLASInt           rows, cols;

  PetscFunctionBegin;
  for (PetscInt i = first; i < last; i++)
    if (sub->fixed[i] || linear->inter->primal_index[i] >= 0) linear->g[i] = 0.0;
  PetscCall(PetscArraycpy(u, coarse->u + coarse->offset[s], coarse->offset[s + 1] - coarse->offset[s]));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    PetscReal            *uf   = u + linear->macro->of[f].at;

    for (PetscInt k = face->side_first; k < face->side_last; k++) {
      const PetscReal *row = LatinMacroDualRow(linear->macro, f, k);

      for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) uf[j] -= row[j] * linear->g[inter->side_dof[k]];
    }
  }
  for (PetscInt i = first; i < last; i++) U[i] += linear->g[i];
  PetscCall(PetscBLASIntCast(last - first, &rows));
  PetscCall(PetscBLASIntCast(coarse->offset[s + 1] - coarse->offset[s], &cols));
  if (cols) PetscCallBLAS("BLASgemv", BLASgemv_("N", &rows, &cols, &one, linear->Phi + linear->phi_offset[s], &rows, u, &inc, &one, U + first, &inc));
  PetscFunctionReturn(0);
}

/* Relocalisation and local solves (42) of a batch whose solver is approximate */
PetscErrorCode LatinInexactSolve_Private(LatinLinear *linear, PetscInt which, PetscReal U[])
{
  const LatinBatch *batch = &linear->batches->batch[which];
  const PetscInt    n     = batch->patterns * batch->members;

  PetscFunctionBegin;
  for (PetscInt m = 0; m < n; m++) LatinInexactBefore(linear, batch->sub[m]);
  PetscCall(LatinLocalSolve_Private(linear->solvers, which, linear->g, linear->g));
  for (PetscInt m = 0; m < n; m++) PetscCall(LatinInexactAfter_Private(linear, batch->sub[m], U));
  PetscFunctionReturn(0);
}
