#include "base/vector.h"
#include "cases/latincases.h"

/*
   The sweeps of a stage over links and rows, for all lanes. dim is a compile-time constant in the callers, so that loops unroll. Displacements and forces
   are in double precision; w and p, solutions of a factor in single precision, are in single.

   1. LatinCasesForces(): residuals r at u.
   2. LatinCasesRound(): right-hand sides of the solve for w, which follows (cases/cases.c).
   3. LatinCasesResistance(): products of w and p with the tangent stiffness.
   4. LatinCasesMove(): the step.
*/

typedef PetscReal Lanes __attribute__((vector_size(LATIN_CASE_LANES * sizeof(PetscReal)), aligned(LATIN_LINE)));
typedef float     Short __attribute__((vector_size(LATIN_CASE_LANES * sizeof(float)), aligned(LATIN_LINE)));

typedef __typeof__((Lanes){0} > (Lanes){0}) Bits;

#define LATIN_WIDE(x) __builtin_convertvector(x, Lanes)

LATIN_INLINE void LatinCasesForces_Dim(LatinCaseLanes *lanes, const PetscInt dim)
{
  const Lanes *u = (const Lanes *)lanes->u, *e0 = (const Lanes *)lanes->e0, one = 1.0 + (Lanes){0.0};
  Lanes       *r = (Lanes *)lanes->r, all = {0.0};
  Short       *tangent = (Short *)lanes->tangent;

  for (PetscInt l = 0; l < lanes->links; l++) {
    const PetscReal k = lanes->stiffness[l], sign = lanes->sign[l], least = sign * sign - 1.0, *n = lanes->direction + dim * l;
    const PetscInt *row = lanes->row + 2 * dim * l;
    Lanes           x   = e0[l], t;

    for (PetscInt c = 0; c < dim; c++) x += n[c] * (u[row[dim + c]] - u[row[c]]);
    /* t = taut ? k : 0, by the sign bit: compilers turn comparisons of vectors longer than registers into loops */
    t          = k * (Lanes)((Bits)one & ((Bits)(least - sign * x) >> (8 * sizeof(PetscReal) - 1)));
    tangent[l] = __builtin_convertvector(t, Short);
    x *= t;
    all += x * x;
    for (PetscInt c = 0; c < dim; c++) {
      r[row[c]] += n[c] * x;
      r[row[dim + c]] -= n[c] * x;
    }
  }
  *(Lanes *)lanes->all = all;
}

/* Computes r = load - B^t tau and tangent stiffnesses at u; all: squared tensions */
LATIN_CLONES void LatinCasesForces(LatinCaseLanes *lanes)
{
  memcpy(lanes->r, lanes->load, LATIN_CASE_LANES * (size_t)lanes->rows * sizeof(*lanes->r));
  if (lanes->dim == 3) LatinCasesForces_Dim(lanes, 3);
  else if (lanes->dim == 2) LatinCasesForces_Dim(lanes, 2);
  else LatinCasesForces_Dim(lanes, 1);
}

/* Computes w = r / scale, for the solve; rr, rp */
LATIN_CLONES void LatinCasesRound(LatinCaseLanes *lanes)
{
  const Lanes  part = 1.0 / *(const Lanes *)lanes->scale, *r = (const Lanes *)lanes->r;
  const Short *p  = (const Short *)lanes->p;
  Short       *v  = (Short *)lanes->w;
  Lanes        rr = {0.0}, rp = {0.0};

  for (PetscInt i = 0; i < lanes->free; i++) {
    const Lanes x = part * r[i];

    v[i] = __builtin_convertvector(x, Short);
    rr += x * x;
    rp += x * LATIN_WIDE(p[i]);
  }
  *(Lanes *)lanes->rr = rr;
  *(Lanes *)lanes->rp = rp;
}

LATIN_INLINE void LatinCasesResistance_Dim(LatinCaseLanes *lanes, const PetscInt dim)
{
  const Short *v = (const Short *)lanes->w, *p = (const Short *)lanes->p, *tangent = (const Short *)lanes->tangent;
  Lanes        wkw = {0.0}, wkp = {0.0}, pkp = {0.0}, tension = {0.0};

  for (PetscInt l = 0; l < lanes->links; l++) {
    const PetscReal *n   = lanes->direction + dim * l;
    const PetscInt  *row = lanes->row + 2 * dim * l;
    Short            e = {0}, d = {0};
    Lanes            k, a, b;

    for (PetscInt c = 0; c < dim; c++) {
      e += (float)n[c] * (v[row[dim + c]] - v[row[c]]);
      d += (float)n[c] * (p[row[dim + c]] - p[row[c]]);
    }
    k = LATIN_WIDE(tangent[l]);
    a = LATIN_WIDE(e);
    b = LATIN_WIDE(d);
    wkw += k * a * a;
    wkp += k * a * b;
    pkp += k * b * b;
    tension += k * k * a * a;
  }
  *(Lanes *)lanes->wkw     = wkw;
  *(Lanes *)lanes->wkp     = wkp;
  *(Lanes *)lanes->pkp     = pkp;
  *(Lanes *)lanes->tension = tension;
}

/* Computes w.K w, w.K p, p.K p with the tangent stiffness K; tension: squared tensions of w */
LATIN_CLONES void LatinCasesResistance(LatinCaseLanes *lanes)
{
  if (lanes->dim == 3) LatinCasesResistance_Dim(lanes, 3);
  else if (lanes->dim == 2) LatinCasesResistance_Dim(lanes, 2);
  else LatinCasesResistance_Dim(lanes, 1);
}

/* Takes the step: p = w + beta p, u += alpha scale p; uu */
LATIN_CLONES void LatinCasesMove(LatinCaseLanes *lanes)
{
  const Lanes step = *(const Lanes *)lanes->alpha * *(const Lanes *)lanes->scale;
  const Short beta = __builtin_convertvector(*(const Lanes *)lanes->beta, Short), *v = (const Short *)lanes->w;
  Short      *p = (Short *)lanes->p;
  Lanes      *u = (Lanes *)lanes->u, uu = {0.0};

  for (PetscInt i = 0; i < lanes->free; i++) {
    p[i] = v[i] + beta * p[i];
    u[i] += step * LATIN_WIDE(p[i]);
    uu += u[i] * u[i];
  }
  *(Lanes *)lanes->uu = uu;
}
