#include "ksp/ksplatinimpl.h"

/*
   The linear iteration as an operator on the interface data alone. Without a link that has a state, linear stage and
   local stage are affine in the data z = F_hat + D U_hat of the interface sides, and the iteration is the composition
   of two maps:

   R   = 2 D P X P^t - 1  from the data of a side to D U - F there: (26) and the linear stage (42)-(52), X from
                        interface forces to displacements, P = 1 - R R^t D the micro part;
   Pi                   what leaves a side is what its mate receives: the local stage (23).

   In the variables y = L^-1 z with D = L L^t, whose Euclidean norm is the energy norm of z, R is symmetric with
   eigenvalues in [-1, 1], for the springs D are part of the operators behind X, and Pi is symmetric and orthogonal. So
   1 - Pi R is what the article's iteration solves with by successive substitution, and Pi - R, with the same solutions,
   is symmetric: indefinite as a saddle point, for its blocks on the data that are equal on both sides, and opposite,
   are 1 - R >= 0 and -(1 + R) <= 0.
*/

/* y = L^t x or L x on one interface, in place */
static PetscErrorCode LatinReflectionFactor_Private(LatinLinear *linear, PetscInt f, PetscBool transposed, PetscReal x[])
{
  const LatinInterface *face = &linear->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  const PetscReal      *d    = linear->dir->d + face->side_first;
  const PetscBLASInt    inc  = 1;
  PetscBLASInt          n;

  PetscFunctionBegin;
  if (linear->dir->matrix_first[f] < 0) {
    for (PetscInt r = 0; r < rows; r++) x[r] *= PetscSqrtReal(d[r]);
    PetscFunctionReturn(0);
  }
  PetscCall(PetscBLASIntCast(rows, &n));
  if (n) PetscCallBLAS("BLAStrmv", BLAStrmv_("L", transposed ? "T" : "N", "N", &n, linear->dir->matrix + linear->dir->matrix_first[f] + rows * rows, &n, x, &inc));
  PetscFunctionReturn(0);
}

/* z = (1 - D R R^t) z on one interface: no macro part */
static PetscErrorCode LatinReflectionProject_Private(LatinLinear *linear, PetscInt f, PetscReal z[])
{
  const LatinInterface *face = &linear->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  PetscReal            *w    = linear->lambda;

  PetscFunctionBegin;
  for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) w[j] = 0.0;
  for (PetscInt r = 0; r < rows; r++) {
    const PetscReal *row = LatinMacroRow(linear->macro, f, face->side_first + r);

    for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) w[j] += row[j] * z[r];
  }
  for (PetscInt r = 0; r < rows; r++) {
    const PetscReal *row = LatinMacroDualRow(linear->macro, f, face->side_first + r);

    for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) z[r] -= row[j] * w[j];
  }
  PetscFunctionReturn(0);
}

/*
   The displacements U of all copies for the loads (if they count) and the data y (if not NULL): one linear stage. Data
   that the iteration makes have no macro part but by rounding, which breaks the symmetry that minres relies on: it is
   taken out.
*/
static PetscErrorCode LatinReflectionStage_Private(LatinLinear *linear, PetscBool loaded, const PetscReal y[])
{
  const LatinInterfaces *inter = linear->inter;
  const PetscInt         n     = linear->sub->bs * linear->sub->copies;

  PetscFunctionBegin;
  if (loaded) PetscCall(PetscArraycpy(linear->g, linear->load, n));
  else PetscCall(PetscArrayzero(linear->g, n));
  for (PetscInt f = 0; y && f < inter->count; f++) {
    const LatinInterface *face = &inter->interface[f];
    PetscReal            *z    = linear->outgoing + face->side_first;

    PetscCall(PetscArraycpy(z, y + face->side_first, face->side_last - face->side_first));
    PetscCall(LatinReflectionFactor_Private(linear, f, PETSC_FALSE, z));
    if (linear->macro->of[f].modes) PetscCall(LatinReflectionProject_Private(linear, f, z));
    for (PetscInt k = face->side_first; k < face->side_last; k++) linear->g[inter->side_dof[k]] += linear->outgoing[k];
  }
  PetscCall(PetscArrayzero(linear->U, n));
  PetscCall(LatinLinearApply(linear, linear->U));
  linear->applications++;
  PetscFunctionReturn(0);
}

/* micro = L^t P U on one interface */
static PetscErrorCode LatinReflectionMicro_Private(LatinLinear *linear, PetscInt f, PetscReal micro[])
{
  const LatinInterface *face = &linear->inter->interface[f];
  const PetscInt        rows = face->side_last - face->side_first;
  PetscReal            *w    = linear->lambda;

  PetscFunctionBegin;
  for (PetscInt r = 0; r < rows; r++) micro[r] = linear->U[linear->inter->side_dof[face->side_first + r]];
  if (linear->macro->of[f].modes) {
    for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) w[j] = 0.0;
    for (PetscInt r = 0; r < rows; r++) {
      const PetscReal *row = LatinMacroDualRow(linear->macro, f, face->side_first + r);

      for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) w[j] += row[j] * micro[r];
    }
    for (PetscInt r = 0; r < rows; r++) {
      const PetscReal *row = LatinMacroRow(linear->macro, f, face->side_first + r);

      for (PetscInt j = 0; j < linear->macro->of[f].modes; j++) micro[r] -= row[j] * w[j];
    }
  }
  PetscCall(LatinReflectionFactor_Private(linear, f, PETSC_TRUE, micro));
  PetscFunctionReturn(0);
}

/* What rounding leaves of interface data, of the energy norm of the first displacements. Collective on sub->object */
static PetscErrorCode LatinReflectionNoise_Private(LatinLinear *linear)
{
  PetscReal energy = 0.0;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < linear->sub->bs * linear->sub->copies; i++) energy += linear->load[i] * linear->U[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &energy, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm(linear->sub->object)));
  linear->noise = LatinByPrecision(1e-14, 5e-6) * PetscSqrtReal(PetscMax(energy, 0.0));
  PetscFunctionReturn(0);
}

/*
   out = (1 - Pi R) y for data y without loads, or, loaded, the right-hand side that the loads make of it without data;
   symmetric: the same times Pi. A rank without interfaces has no y (NULL) either way. Collective on sub->object.
*/
PetscErrorCode LatinReflectionApply_Private(LatinLinear *linear, PetscBool loaded, const PetscReal y[], PetscBool symmetric, PetscReal out[])
{
  const LatinInterfaces *inter = linear->inter;
  PetscReal             *mine  = linear->outgoing;

  PetscFunctionBegin;
  PetscCall(LatinReflectionStage_Private(linear, loaded, loaded ? NULL : y));
  if (loaded) PetscCall(LatinReflectionNoise_Private(linear));
  PetscCall(PetscLogEventBegin(LATIN_Local, linear->sub->object, 0, 0, 0));
  for (PetscInt f = 0; f < inter->count; f++) PetscCall(LatinReflectionMicro_Private(linear, f, mine + inter->interface[f].side_first));
  if (loaded) {
    for (PetscInt k = 0; k < inter->sides; k++) mine[k] *= 2.0;
    if (symmetric) PetscCall(PetscArraycpy(out, mine, inter->sides));
    else PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, out));
  } else if (symmetric) {
    PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, y, out));
    for (PetscInt k = 0; k < inter->sides; k++) out[k] += y[k] - 2.0 * mine[k];
  } else {
    for (PetscInt k = 0; k < inter->sides; k++) mine[k] = 2.0 * mine[k] - y[k];
    PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, out));
    for (PetscInt k = 0; k < inter->sides; k++) out[k] = y[k] - out[k];
  }
  PetscCall(PetscLogEventEnd(LATIN_Local, linear->sub->object, 0, 0, 0));
  PetscFunctionReturn(0);
}

/* u = mean displacement of the copies for the loads and the data y; zero for unknowns of no subdomain. Collective on sub->object */
PetscErrorCode LatinReflectionSolution_Private(LatinLinear *linear, const PetscReal y[], Vec u)
{
  PetscFunctionBegin;
  PetscCall(LatinReflectionStage_Private(linear, PETSC_TRUE, y));
  PetscCall(LatinAverage_Private(linear, u));
  PetscFunctionReturn(0);
}
