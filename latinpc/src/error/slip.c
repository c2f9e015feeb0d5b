#include "error/latinerror.h"

/*
   Contacts with Coulomb friction in the interior-point method of error/primaldual.c. With y the compression of a contact, t its tangential
   tensions, x_n and x its normal and tangential elongations, and l the rate at which it slips:

     X = (b, t),  S = (l, -x)  in the cone of the first component at least as long as the others,  X.S = 0,  b = mu y.

   A contact that sticks has x = 0, and one that slips mu y = |t|, x = l t / |t|: friction is not associated, x has no normal part. In the
   interior X o S = mean (1, 0), with the product of the cone, X o S = (X.S, X_0 S_r + S_0 X_r) [F. Alizadeh, D. Goldfarb]. Its
   linearisation, without l, gives the tangential tensions, M dt = h + P dx - z db, and so a tangent stiffness that is not symmetric: the
   friction bound b follows the normal tension, and not conversely. The operator is assembled, and its factors are LU. M is regularised as
   normal tensions are. There is no energy: with b = mu y the path to the solution may turn back, and then steps become short. With fixed b there is
   one, it is convex, and steps are long. So b is an unknown of its own and follows mu y by a part of the difference: db = follow (mu (y + dy) - b).
*/

#define LATIN_SLIP_INSIDE 0.01 /* least product of the small eigenvalue of X and the large one of S, and conversely, relative to X.S */

/* Allocates the slips of the contacts of this rank. Not collective */
PetscErrorCode LatinSlipsCreate_Private(LatinPrimalDual *c)
{
  PetscInt n = 0;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < c->n && c->structure->has_friction; l++) n += LatinSlipMay(c, l);
  PetscCall(PetscCalloc1(n, &c->slip));
  for (PetscInt l = 0; l < c->n && c->slips < n; l++)
    if (LatinSlipMay(c, l)) c->slip[c->slips++].link = l;
  PetscFunctionReturn(0);
}

/* Computes X of a contact from its friction bound and the tensions t of its links, or its change from theirs */
static void LatinSlipTensions(const LatinPrimalDual *c, const LatinSlip *slip, PetscReal bound, const PetscReal t[], PetscReal X[3])
{
  X[0] = bound;
  for (PetscInt i = 1; i < c->structure->dim; i++) X[i] = t[slip->link + i];
}

/* Returns the part of mu y - b that a step makes up for, if the normal tension changes by dt */
static PetscReal LatinSlipFollow(const LatinPrimalDual *c, const LatinSlip *slip, PetscReal dt)
{
  return -c->follow * (c->structure->friction[slip->link] * (c->t[slip->link] + dt) + slip->bound);
}

/* Returns the size of the tangential elongation of a contact */
static PetscReal LatinSlipSize(const LatinPrimalDual *c, const LatinSlip *slip)
{
  PetscReal sum = 0.0;

  for (PetscInt i = 1; i < c->structure->dim; i++) sum += PetscSqr(c->x[slip->link + i]);
  return PetscSqrtReal(sum);
}

/* Computes p o q, the product of the cone */
static void LatinSlipProduct(PetscInt dim, const PetscReal p[], const PetscReal q[], PetscReal product[])
{
  product[0] = p[0] * q[0];
  for (PetscInt i = 1; i < dim; i++) {
    product[0] += p[i] * q[i];
    product[i] = p[0] * q[i] + q[0] * p[i];
  }
}

/* Computes the difference of the tangential parts of S from their values by the elongations */
static void LatinSlipMissed(const LatinPrimalDual *c, const LatinSlip *slip, PetscReal missed[3])
{
  missed[0] = 0.0;
  for (PetscInt i = 1; i < c->structure->dim; i++) missed[i] = -c->x[slip->link + i] - slip->S[i];
}

/* Computes the initial point: S as far inside as the normal part, no tangential tension. Not collective */
void LatinSlipsStart(LatinPrimalDual *c)
{
  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip *slip = &c->slip[k];

    slip->bound = -c->structure->friction[slip->link] * c->t[slip->link];
    slip->S[0]  = LatinSlipSize(c, slip) + c->inside[1];
    for (PetscInt i = 1; i < c->structure->dim; i++) slip->S[i] = -c->x[slip->link + i];
  }
}

/* Computes P and z of a contact from X and S */
static void LatinSlipParts(PetscInt dim, const PetscReal X[], const PetscReal S[], PetscReal P[4], PetscReal z[2])
{
  const PetscInt q = dim - 1;

  for (PetscInt i = 0; i < q * q; i++) P[i] = (i / q == i % q ? X[0] : 0.0) - X[1 + i / q] * X[1 + i % q] / X[0];
  for (PetscInt i = 0; i < q; i++) z[i] = S[1 + i] - X[1 + i] * S[0] / X[0];
}

/* Computes M^-1, and the tangent stiffness of the tangential parts: M^-1 P, and with the normal elongation M^-1 z follow mu w */
static void LatinSlipTangent(LatinPrimalDual *c, LatinSlip *slip, const PetscReal X[])
{
  const PetscInt dim = c->structure->dim, q = dim - 1;
  PetscReal      M[4] = {0.0}, P[4], z[2];

  LatinSlipParts(dim, X, slip->S, P, z);
  for (PetscInt i = 0; i < q * q; i++) M[i] = (i / q == i % q ? slip->S[0] : 0.0) - X[1 + i / q] * slip->S[1 + i % q] / X[0] + c->regularisation * P[i];
  if (q == 1) slip->inverse[0] = 1.0 / M[0];
  else {
    const PetscReal det = M[0] * M[3] - M[1] * M[2];

    slip->inverse[0] = M[3] / det;
    slip->inverse[1] = -M[1] / det;
    slip->inverse[2] = -M[2] / det;
    slip->inverse[3] = M[0] / det;
  }
  for (PetscInt i = 0; i < dim * dim; i++) slip->tangent[i] = 0.0;
  for (PetscInt i = 0; i < q; i++)
    for (PetscInt m = 0; m < q; m++) {
      slip->tangent[dim * (1 + i)] += slip->inverse[q * i + m] * z[m] * c->follow * c->structure->friction[slip->link] * c->w[slip->link];
      for (PetscInt j = 0; j < q; j++) slip->tangent[dim * (1 + i) + 1 + j] += slip->inverse[q * i + m] * P[q * m + j];
    }
}

/* Computes the tangent stiffnesses, after the weights of the normal parts. Not collective */
void LatinSlipsWeights(LatinPrimalDual *c)
{
  for (PetscInt k = 0; k < c->slips; k++) {
    PetscReal X[3];

    LatinSlipTensions(c, &c->slip[k], c->slip[k].bound, c->t, X);
    LatinSlipTangent(c, &c->slip[k], X);
  }
}

/*
   Computes the steps of tensions at dx = 0, towards X o S = mean (1, 0), or 0 in a predictor step. corrects: with the second-order term of the last
   step. step: on entry those of normal parts. Not collective
*/
void LatinSlipsBegin(LatinPrimalDual *c, PetscBool corrects, PetscReal mean, PetscReal step[])
{
  const PetscInt dim = c->structure->dim, q = dim - 1;

  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip *slip = &c->slip[k];
    PetscReal *own = step + slip->link, X[3], dX[3], now[3], second[3], missed[3], left[3] = {0.0}, P[4], z[2];

    LatinSlipTensions(c, slip, slip->bound, c->t, X);
    LatinSlipTensions(c, slip, slip->dbound, c->dt, dX);
    LatinSlipMissed(c, slip, missed);
    LatinSlipProduct(dim, X, slip->S, now);
    LatinSlipProduct(dim, dX, slip->dS, second);
    for (PetscInt i = 0; i < dim; i++) left[i] = (corrects && !i ? mean : 0.0) - now[i] - (corrects ? second[i] : 0.0);
    slip->rhs = left[0];
    LatinSlipParts(dim, X, slip->S, P, z);
    for (PetscInt i = 0; i < q; i++) {
      left[1 + i] -= z[i] * LatinSlipFollow(c, slip, own[0]) + X[1 + i] * slip->rhs / X[0];
      for (PetscInt j = 0; j < q; j++) left[1 + i] -= P[q * i + j] * missed[1 + j];
    }
    for (PetscInt i = 0; i < q; i++) {
      own[1 + i] = 0.0;
      for (PetscInt j = 0; j < q; j++) own[1 + i] += slip->inverse[q * i + j] * left[1 + j];
    }
  }
}

/* Computes the steps of the tensions and of S for the elongations c->dx. Not collective */
void LatinSlipsEnd(LatinPrimalDual *c)
{
  const PetscInt dim = c->structure->dim;

  for (PetscInt k = 0; k < c->slips; k++) {
    LatinSlip       *slip = &c->slip[k];
    const PetscReal *dx   = c->dx + slip->link;
    PetscReal        X[3], dX[3];

    for (PetscInt i = 1; i < dim; i++)
      for (PetscInt j = 0; j < dim; j++) c->dt[slip->link + i] += slip->tangent[dim * i + j] * dx[j];
    slip->dbound = LatinSlipFollow(c, slip, c->dt[slip->link]);
    LatinSlipTensions(c, slip, slip->bound, c->t, X);
    LatinSlipTensions(c, slip, slip->dbound, c->dt, dX);
    LatinSlipMissed(c, slip, slip->dS);
    for (PetscInt i = 1; i < dim; i++) slip->dS[i] += c->regularisation * dX[i] - dx[i];
    slip->dS[0] = slip->rhs - slip->S[0] * dX[0];
    for (PetscInt i = 1; i < dim; i++) slip->dS[0] -= slip->S[i] * dX[i] + X[i] * slip->dS[i];
    slip->dS[0] /= X[0];
  }
}

/* Returns the longest step a, at most `most`, that keeps v + a dv in the cone */
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
  root = PetscSqrtReal(PetscMax(PetscSqr(b) - a * inside, 0.0));          /* negative by rounding only, for steps through the apex */
  return PetscMin(most, b > 0.0 ? (root + b) / -a : inside / (root - b)); /* avoids differences of near numbers */
}

/* Shortens a step so that it keeps all X and S in their cones. Not collective */
void LatinSlipsLength(const LatinPrimalDual *c, PetscReal *length)
{
  for (PetscInt k = 0; k < c->slips; k++) {
    PetscReal X[3], dX[3];

    LatinSlipTensions(c, &c->slip[k], c->slip[k].bound, c->t, X);
    LatinSlipTensions(c, &c->slip[k], c->slip[k].dbound, c->dt, dX);
    *length = LatinSlipLongest(c->structure->dim, X, dX, *length);
    *length = LatinSlipLongest(c->structure->dim, c->slip[k].S, c->slip[k].dS, *length);
  }
}

/* Returns the sum of the products X.S after a step of this length. Not collective */
PetscReal LatinSlipsProducts(const LatinPrimalDual *c, PetscReal length)
{
  PetscReal sum = 0.0;

  for (PetscInt k = 0; k < c->slips; k++) {
    const LatinSlip *slip = &c->slip[k];
    PetscReal        X[3], dX[3];

    LatinSlipTensions(c, slip, slip->bound, c->t, X);
    LatinSlipTensions(c, slip, slip->dbound, c->dt, dX);
    for (PetscInt i = 0; i < c->structure->dim; i++) sum += (X[i] + length * dX[i]) * (slip->S[i] + length * slip->dS[i]);
  }
  return sum;
}

/*
   Moves X and S of a contact away from the boundaries of their cones, relative to X.S, by a larger friction bound and a larger rate of slip. The next
   step takes both back. A point at the boundary of one cone alone makes each step end there, 20 times shorter than the last one
*/
static void LatinSlipInside(const LatinPrimalDual *c, LatinSlip *slip)
{
  PetscReal X[3], X_size = 0.0, S_size = 0.0, least = 0.0;

  LatinSlipTensions(c, slip, slip->bound, c->t, X);
  for (PetscInt i = 0; i < c->structure->dim; i++) {
    least += LATIN_SLIP_INSIDE * X[i] * slip->S[i];
    X_size += i ? PetscSqr(X[i]) : 0.0;
    S_size += i ? PetscSqr(slip->S[i]) : 0.0;
  }
  X_size      = PetscSqrtReal(X_size);
  S_size      = PetscSqrtReal(S_size);
  slip->bound = PetscMax(slip->bound, X_size + least / (slip->S[0] + S_size));
  slip->S[0]  = PetscMax(slip->S[0], S_size + least / (slip->bound + X_size));
}

/* Takes the steps of S and of the friction bounds. Not collective */
void LatinSlipsMove(LatinPrimalDual *c)
{
  for (PetscInt k = 0; k < c->slips; k++) {
    c->slip[k].bound += c->length * c->slip[k].dbound;
    for (PetscInt i = 0; i < c->structure->dim; i++) c->slip[k].S[i] += c->length * c->slip[k].dS[i];
    if (c->length < LATIN_SLIP_SHORT) LatinSlipInside(c, &c->slip[k]);
  }
}

/* Returns the sum of the squared differences mu y - b. Not collective */
PetscReal LatinSlipsLag(const LatinPrimalDual *c)
{
  PetscReal sum = 0.0;

  for (PetscInt k = 0; k < c->slips; k++) sum += PetscSqr(c->structure->friction[c->slip[k].link] * c->t[c->slip[k].link] + c->slip[k].bound);
  return sum;
}

/* Adds the tangent stiffnesses of contacts to a matrix that is not assembled yet. Not collective */
PetscErrorCode LatinSlipsAdd_Private(const LatinPrimalDual *c, Mat A)
{
  const PetscInt dim = c->structure->dim;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < c->slips; k++)
    for (PetscInt i = 1; i < dim; i++)
      for (PetscInt j = 0; j < dim; j++) PetscCall(LatinStructureAddLinks_Private(c->structure, c->slip[k].link + i, c->slip[k].link + j, c->slip[k].tangent[dim * i + j], A));
  PetscFunctionReturn(0);
}
