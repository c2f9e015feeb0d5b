#include "stages/latinstages.h"

/*
   Local stage for all laws: rigid laws, tables, the user's, and contacts with friction, whose parts are coupled. Structures
   of bars, cables and compression-only links alone use the faster loop of stages/locallinks.c.
*/

/*
   Solves a contact with friction, Coulomb's law in its own frame: dim consecutive links of the same end nodes, first along the normal, then tangential
   ones orthonormal to it, with the same ascent direction l. With r = y + l e0, that is tau_hat + l x_hat, the conditions decouple:

     normal     tau_n = min(r_n, 0), compression, x_n >= 0
     stick      |r_t| <= mu |tau_n|: tau_t = r_t, x_t = 0
     slip       else tau_t = mu |tau_n| r_t / |r_t|, x_t along r_t: friction opposes the slip
*/
static void LatinContactLocal(PetscInt dim, PetscReal l, PetscReal mu, const PetscReal e0[], const PetscReal y[], PetscReal tension[])
{
  PetscReal size = 0.0, least, scale = 0.0;

  tension[0] = LatinRigidTension(LatinLawSign(LATIN_LAW_CONTACT), l, e0[0], y[0]);
  for (PetscInt c = 1; c < dim; c++) size += PetscSqr(y[c] + l * e0[c]);
  size  = PetscSqrtReal(size);
  least = -mu * tension[0];
  if (size <= least) scale = 1.0;
  else if (least > 0.0) scale = least / size;
  for (PetscInt c = 1; c < dim; c++) tension[c] = scale * (y[c] + l * e0[c]);
}

/*
   Performs the local stage of all links here. Adds to sum: the squared distance; the energy of elongations under tension; the same with initial
   elongations. A rigid link stores no energy: tau_hat^2 / l takes the place of k e^2 of a bar. So the indicator compares differences of tensions with
   tensions, for any l.
*/
void LatinLinkStageGeneral(const LatinLinear *linear, const PetscReal state[], PetscReal next[], PetscReal sum[3])
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         dim = linear->sub->structure->dim;

  for (PetscInt s = 0, i = 0; s < sub->n; s++) {
    const PetscInt   r = linear->batches->pattern[s], other = sub->link_offset[r] - sub->link_offset[s];
    const PetscReal *U = linear->U + dim * (sub->node_offset[s] - sub->node_offset[r]);

    for (PetscInt l = sub->link_offset[s]; l < sub->link_offset[s + 1];) {
      const PetscInt  parts = sub->law[l] == LATIN_LAW_FRICTION ? dim : 1;
      const PetscReal k     = sub->stiffness[l + other];
      PetscReal       e[3] = {0.0, 0.0, 0.0}, y[3], tension[3] = {0.0, 0.0, 0.0};

      for (PetscInt c = 0; c < parts; c++) e[c] = LatinElongation(sub, dim, l + other + c, U);
      if (i >= sub->nonsmooth || sub->nonsmooth_link[i] != l) {
        if (LatinLaws[sub->law[l]].smooth) {
          sum[1] += k * e[0] * e[0];
          sum[2] += k * PetscSqr(e[0] + sub->e0[l]);
        }
        l += parts;
        continue;
      }
      for (PetscInt c = 0; c < parts; c++) y[c] = state[i + c] + 2.0 * k * e[c];
      if (sub->law[l] == LATIN_LAW_FRICTION) {
        LatinContactLocal(dim, k, sub->friction[l], sub->e0 + l, y, tension);
        for (PetscInt c = 0; c < dim; c++) next[i + c] = 2.0 * tension[c] - y[c]; /* tau_hat - l e_hat */
      } else {
        next[i]    = LatinLawLocal(sub->law[l], k, sub->e0[l], y[0]);
        tension[0] = 0.5 * (y[0] + next[i]);
      }
      for (PetscInt c = 0; c < parts; c++, i++) {
        const PetscReal carried = PetscSqr(tension[c]) / k;

        if (linear->tension) linear->tension[i] = tension[c];
        sum[0] += PetscSqr(next[i] - state[i]) / (4.0 * k);
        sum[1] += LatinLaws[sub->law[l]].rigid ? carried : PetscAbsReal(e[c]) * PetscMin(k * PetscAbsReal(e[c]), PetscAbsReal(tension[c]));
        sum[2] += carried;
      }
      l += parts;
    }
  }
}
