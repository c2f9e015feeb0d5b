#include "ksp/ksplatinimpl.h"

/*
   The linear iteration as an operator on interface data. If no link has a state, linear stage and local stage are affine in the data z = F_hat + D U_hat
   of the sides, and the iteration is the composition of two maps:

   R = 2 D P X P^t - 1  from data to D U - F on the same side: (26) and the linear stage (42)-(52); X: from interface forces to displacements;
                        P: projection on the micro part, 1 - V V^t D with the macro basis V (R in interfaces/macrobasis.c);
   Pi                   exchanges the data of the two sides of each interface: the local stage (23).

   In the variables y = L^-1 z with D = L L^t, the Euclidean norm is the energy norm of z. R is symmetric with eigenvalues in [-1, 1], as the springs D are
   part of the operators in X; Pi is symmetric and orthogonal. The article's iteration is successive substitution (Richardson) with the operator 1 - Pi R.
   Pi - R has the same solutions and is symmetric, but indefinite: MINRES takes more than twice the iterations with it.
*/

#define LATIN_INTERFACE_NOISE LatinByPrecision(1e-14, 5e-6) /* level of rounding of interface data, relative to the energy norm */

/* Multiplies x by L, or by L^t if transposed, on interface f, in place. Not collective */
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

/* Takes a linear stage: computes linear->U, of all copies, under the loads (if loaded) and the micro part of the data y (or NULL). Collective on sub->object */
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
    LatinMacroMicro(linear->macro, f, PETSC_TRUE, z, linear->lambda);
    for (PetscInt k = face->side_first; k < face->side_last; k++) linear->g[inter->side_dof[k]] += linear->outgoing[k];
  }
  PetscCall(PetscArrayzero(linear->U, n));
  PetscCall(LatinLinearApply(linear, linear->U));
  linear->applications++;
  PetscFunctionReturn(0);
}

/* Computes result = (1 - Pi R) data; data NULL: the right-hand side for the loads, and linear->noise. Collective on sub->object */
PetscErrorCode LatinReflectionApply_Private(LatinLinear *linear, Vec data, Vec result)
{
  const LatinInterfaces *inter  = linear->inter;
  const PetscBool        loaded = (PetscBool)!data;
  PetscReal             *mine   = linear->outgoing;
  const PetscScalar     *y      = NULL;
  PetscScalar           *out;
  PetscReal              energy = 0.0;

  PetscFunctionBegin;
  if (data) PetscCall(VecGetArrayRead(data, &y));
  PetscCall(VecGetArrayWrite(result, &out));
  PetscCall(LatinReflectionStage_Private(linear, loaded, y));
  if (loaded) { /* level of rounding, from the energy norm of the first displacements */
    for (PetscInt i = 0; i < linear->sub->bs * linear->sub->copies; i++) energy += linear->load[i] * linear->U[i];
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &energy, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm(linear->sub->object)));
    linear->noise = LATIN_INTERFACE_NOISE * PetscSqrtReal(PetscMax(energy, 0.0));
  }
  PetscCall(PetscLogEventBegin(LATIN_Local, linear->sub->object, 0, 0, 0));
  for (PetscInt f = 0; f < inter->count; f++) { /* mine = R y = 2 L^t P U - y */
    const LatinInterface *face = &inter->interface[f];

    for (PetscInt k = face->side_first; k < face->side_last; k++) mine[k] = linear->U[inter->side_dof[k]];
    LatinMacroMicro(linear->macro, f, PETSC_FALSE, mine + face->side_first, linear->lambda);
    PetscCall(LatinReflectionFactor_Private(linear, f, PETSC_TRUE, mine + face->side_first));
    for (PetscInt k = face->side_first; k < face->side_last; k++) mine[k] = loaded ? 2.0 * mine[k] : 2.0 * mine[k] - y[k];
  }
  PetscCall(LatinSFBcast_Private(inter->mate_sf, 1, MPIU_REAL, mine, out));
  for (PetscInt k = 0; k < inter->sides && !loaded; k++) out[k] = y[k] - out[k];
  PetscCall(PetscLogFlops((loaded ? 1.0 : 3.0) * inter->sides));
  PetscCall(PetscLogEventEnd(LATIN_Local, linear->sub->object, 0, 0, 0));
  if (data && linear->failed && inter->sides) out[0] = INFINITY; /* all ranks see it in the next norm, or at the end */
  if (data) PetscCall(VecRestoreArrayRead(data, &y));
  PetscCall(VecRestoreArrayWrite(result, &out));
  PetscFunctionReturn(0);
}

/* Computes u, the mean displacements of the copies under the loads and the data y. Collective on sub->object */
PetscErrorCode LatinReflectionSolution_Private(LatinLinear *linear, Vec y, Vec u)
{
  const PetscScalar *a;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(y, &a));
  PetscCall(LatinReflectionStage_Private(linear, PETSC_TRUE, a));
  PetscCall(VecRestoreArrayRead(y, &a));
  PetscCall(LatinAverage_Private(linear, u));
  PetscFunctionReturn(0);
}
