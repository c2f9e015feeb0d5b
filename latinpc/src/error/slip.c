#include "error/latinerror.h"

/*
   Contacts with Coulomb friction in the interior-point method of error/primaldual.c. With y the compression of a contact, t its tangential
   tensions, x its tangential elongation, and l the rate at which it slips:

     X = (mu y, t),  S = (l, -x)  in the cone of the first component at least as long as the others,  X.S = 0.

   A contact that sticks has x = 0, and one that slips mu y = |t|, x = l t / |t|: friction is not associated, x has no normal part. In the
   interior X o S = mean (1, 0), with the product of the cone, X o S = (X.S, X_0 S_r + S_0 X_r) [F. Alizadeh, D. Goldfarb]. Its
   linearisation gives the tangential tensions, M dt = h + P dx + z mu dt_n with the normal tension t_n = -y, and so a tangent
   stiffness that is not symmetric: the friction bound follows the normal tension, and not conversely. The operator is assembled, and
   its factors are LU. M is regularised as normal tensions are.

   There is no energy: the path to the solution may turn back, and then steps become short.
*/

/* May a contact slip: is link l one with a coefficient of friction, and not open? */
static PetscBool LatinSlipMay(const LatinPrimalDual *c, PetscInt l)
{
  return (PetscBool)(c->structure->law[l] == LATIN_LAW_FRICTION && c->structure->friction[l] > 0.0 && !LatinPrimalDualOpen(c, l));
}

/* Slips of the contacts here. Not collective */
PetscErrorCode LatinSlipsCreate_Private(LatinPrimalDual *c)
{
  const LatinStructure structure = c->structure;
  PetscInt             n         = 0;

  PetscFunctionBegin;
  if (!structure->rubs || structure->dim == 1) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < c->n; l++) n += LatinSlipMay(c, l);
  PetscCall(PetscCalloc1(n, &c->slip));
  for (PetscInt l = 0; l < c->n; l++)
    if (LatinSlipMay(c, l)) c->slip[c->slips++].link = l;
  PetscFunctionReturn(0);
}

/* X of a contact */
static void LatinSlipTensions(const LatinPrimalDual *c, const LatinSlip *slip, PetscReal X[3])
{
  X[0] = c->structure->friction[slip->link] * c->side[slip->link][1].y;
  for (PetscInt i = 1; i < c->structure->dim; i++) X[i] = c->t[slip->link + i];
}

/* dX of a contact */
static void LatinSlipTensionSteps(const LatinPrimalDual *c, const LatinSlip *slip, PetscReal dX[3])
{
  dX[0] = -c->structure->friction[slip->link] * c->dt[slip->link];
  for (PetscInt i = 1; i < c->structure->dim; i++) dX[i] = c->dt[slip->link + i];
}

/* Initial point: S as far inside as the normal part, no tangential tension. Not collective */
void LatinSlipsStart(LatinPrimalDual *c)
{
  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip *slip = &c->slip[k];
    PetscReal  sum  = 0.0;

    for (PetscInt i = 1; i < c->structure->dim; i++) {
      slip->S[i] = -c->x[slip->link + i];
      sum += PetscSqr(slip->S[i]);
    }
    slip->S[0] = PetscSqrtReal(sum) + c->inside[1];
  }
}

/* M^-1, P and z from X and S; their tangent stiffnesses. The weights of the normal parts come first. Not collective */
void LatinSlipsWeights(LatinPrimalDual *c)
{
  const PetscInt q = c->structure->dim - 1;

  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip *slip = &c->slip[k];
    PetscReal  X[3], M[4], det;

    LatinSlipTensions(c, slip, X);
    for (PetscInt i = 0; i < q * q; i++) {
      const PetscInt a = 1 + i / q, b = 1 + i % q;

      slip->P[i] = (a == b ? X[0] : 0.0) - X[a] * X[b] / X[0];
      M[i]       = (a == b ? slip->S[0] : 0.0) - X[a] * slip->S[b] / X[0] + c->regularisation * slip->P[i];
    }
    for (PetscInt i = 0; i < q; i++) slip->z[i] = slip->S[1 + i] - X[1 + i] * slip->S[0] / X[0];
    if (q == 1) slip->inverse[0] = 1.0 / M[0];
    else {
      det              = M[0] * M[3] - M[1] * M[2];
      slip->inverse[0] = M[3] / det;
      slip->inverse[1] = -M[1] / det;
      slip->inverse[2] = -M[2] / det;
      slip->inverse[3] = M[0] / det;
    }
  }
}

/* dt of the tangential links of a contact: M^-1 (h + P dx + z mu dt_n) */
static void LatinSlipStep(LatinPrimalDual *c, const LatinSlip *slip, const PetscReal dx[], PetscReal normal, PetscReal dt[])
{
  const PetscInt q = c->structure->dim - 1;
  PetscReal      v[2];

  for (PetscInt i = 0; i < q; i++) {
    v[i] = slip->h[i] + slip->z[i] * c->structure->friction[slip->link] * normal;
    for (PetscInt j = 0; j < q && dx; j++) v[i] += slip->P[q * i + j] * dx[j];
  }
  for (PetscInt i = 0; i < q; i++) {
    dt[i] = 0.0;
    for (PetscInt j = 0; j < q; j++) dt[i] += slip->inverse[q * i + j] * v[j];
  }
}

/* Right-hand sides h of a predictor or corrector step, and the steps of tensions at dx = 0: of the normal parts given, of the tangential ones set. Not collective */
void LatinSlipsBegin(LatinPrimalDual *c, PetscBool corrects, PetscReal mean, PetscReal step[])
{
  const PetscInt dim = c->structure->dim, q = dim - 1;

  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip *slip = &c->slip[k];
    PetscReal  X[3], dX[3];

    LatinSlipTensions(c, slip, X);
    LatinSlipTensionSteps(c, slip, dX);
    slip->rhs = corrects ? mean : 0.0;
    for (PetscInt i = 0; i < dim; i++) slip->rhs -= X[i] * slip->S[i] + (corrects ? dX[i] * slip->dS[i] : 0.0);
    for (PetscInt i = 0; i < q; i++) {
      slip->h[i] = -X[0] * slip->S[1 + i] - slip->S[0] * X[1 + i] - X[1 + i] * slip->rhs / X[0];
      if (corrects) slip->h[i] -= dX[0] * slip->dS[1 + i] + slip->dS[0] * dX[1 + i];
      for (PetscInt j = 0; j < q; j++) slip->h[i] += slip->P[q * i + j] * (c->x[slip->link + 1 + j] + slip->S[1 + j]);
    }
    LatinSlipStep(c, slip, NULL, step[slip->link], step + slip->link + 1);
  }
}

/* Steps of the tangential tensions and of S for the elongations c->dx. Not collective */
void LatinSlipsEnd(LatinPrimalDual *c)
{
  const PetscInt dim = c->structure->dim;

  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip *slip = &c->slip[k];
    PetscReal  X[3], dX[3];

    LatinSlipTensions(c, slip, X);
    LatinSlipStep(c, slip, c->dx + slip->link + 1, c->dt[slip->link], c->dt + slip->link + 1);
    LatinSlipTensionSteps(c, slip, dX);
    slip->dS[0] = slip->rhs - slip->S[0] * dX[0];
    for (PetscInt i = 1; i < dim; i++) {
      slip->dS[i] = c->regularisation * dX[i] - slip->S[i] - c->x[slip->link + i] - c->dx[slip->link + i];
      slip->dS[0] -= slip->S[i] * dX[i] + X[i] * slip->dS[i];
    }
    slip->dS[0] /= X[0];
  }
}

/* The longest step a that keeps v + a dv in the cone, at most `most` */
static PetscReal LatinSlipLongest(PetscInt dim, const PetscReal v[], const PetscReal dv[], PetscReal most)
{
  PetscReal size = 0.0, a = PetscSqr(dv[0]), b = v[0] * dv[0], inside, root;

  for (PetscInt i = 1; i < dim; i++) {
    size += PetscSqr(v[i]);
    a -= PetscSqr(dv[i]);
    b -= v[i] * dv[i];
  }
  size   = PetscSqrtReal(size);
  inside = PetscMax(v[0] - size, PETSC_MACHINE_EPSILON * v[0]) * (v[0] + size);
  if (a >= 0.0 && b >= 0.0) return most;
  root = PetscSqrtReal(PetscMax(PetscSqr(b) - a * inside, 0.0));          /* negative by rounding alone, for steps through the apex */
  return PetscMin(most, b > 0.0 ? (root + b) / -a : inside / (root - b)); /* no difference of near numbers */
}

/* Shortens a step so that it keeps all X and S in their cones. Not collective */
void LatinSlipsLength(const LatinPrimalDual *c, PetscReal *length)
{
  for (PetscInt k = 0; k < c->slips; k++) {
    PetscReal X[3], dX[3];

    LatinSlipTensions(c, &c->slip[k], X);
    LatinSlipTensionSteps(c, &c->slip[k], dX);
    *length = LatinSlipLongest(c->structure->dim, X, dX, *length);
    *length = LatinSlipLongest(c->structure->dim, c->slip[k].S, c->slip[k].dS, *length);
  }
}

/* Sum of the products X.S after a step of this length. Not collective */
PetscReal LatinSlipsProducts(const LatinPrimalDual *c, PetscReal length)
{
  PetscReal sum = 0.0;

  for (PetscInt k = 0; k < c->slips; k++) {
    const LatinSlip *slip = &c->slip[k];
    PetscReal        X[3], dX[3];

    LatinSlipTensions(c, slip, X);
    LatinSlipTensionSteps(c, slip, dX);
    for (PetscInt i = 0; i < c->structure->dim; i++) sum += (X[i] + length * dX[i]) * (slip->S[i] + length * slip->dS[i]);
  }
  return sum;
}

/* Takes the step of S. Not collective */
void LatinSlipsMove(LatinPrimalDual *c, PetscReal length)
{
  for (PetscInt k = 0; k < c->slips; k++)
    for (PetscInt i = 0; i < c->structure->dim; i++) c->slip[k].S[i] += length * c->slip[k].dS[i];
}

/* Adds the tangent stiffnesses of the tangential parts to a matrix that is not assembled yet. Not collective */
PetscErrorCode LatinSlipsAdd_Private(const LatinPrimalDual *c, Mat A)
{
  const PetscInt q = c->structure->dim - 1;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < c->slips; k++) {
    const LatinSlip *slip = &c->slip[k];
    const PetscInt   l    = slip->link;

    for (PetscInt i = 0; i < q; i++) {
      PetscReal cross = 0.0;

      for (PetscInt j = 0; j < q; j++) {
        PetscReal w = 0.0;

        for (PetscInt m = 0; m < q; m++) w += slip->inverse[q * i + m] * slip->P[q * m + j];
        PetscCall(LatinStructureAddLinks_Private(c->structure, l + 1 + i, l + 1 + j, w, A));
        cross += slip->inverse[q * i + j] * slip->z[j];
      }
      PetscCall(LatinStructureAddLinks_Private(c->structure, l + 1 + i, l, cross * c->structure->friction[l] * c->w[l], A));
    }
  }
  PetscFunctionReturn(0);
}
