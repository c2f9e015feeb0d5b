#include "stages/latinstages.h"
#include "base/vector.h"

/*
   The two sweeps of an iteration over the links, forces and local stage. Equal subdomains (localsolvers/batches.c) read the ends, directions and
   stiffnesses of the first of them, which stay in cache. dim is a compile-time constant in the callers, so that loops unroll.
*/

/* Links of a subdomain: data that equal subdomains share, and its own */
typedef struct {
  PetscInt         links, first;               /* number of links; the first copy of the subdomain that `ends` refer to */
  const PetscInt  *ends, *law, *state;         /* [links][2] copies; [links] */
  const PetscReal *direction, *stiffness, *e0; /* [links][dim], [links], [links] */
  const PetscReal *U;                          /* displacements of its copies */
} LatinLinks;

LATIN_INLINE LatinLinks LatinLinksOpen(const LatinLinear *linear, const PetscInt dim, PetscInt s)
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         r = linear->batches->pattern[s], own = sub->link_offset[s], shared = sub->link_offset[r];

  return (LatinLinks){
    .links     = sub->link_offset[s + 1] - own,
    .first     = sub->node_offset[r],
    .ends      = sub->ends + 2 * shared,
    .law       = sub->law + own,
    .state     = sub->state + own,
    .direction = sub->direction + dim * shared,
    .stiffness = sub->stiffness + shared,
    .e0        = sub->e0 + own,
    .U         = linear->U + dim * sub->node_offset[s],
  };
}

/* Returns the elongation of link l, a row of B */
LATIN_INLINE PetscReal LatinLinksElongation(const LatinLinks *links, const PetscInt dim, PetscInt l)
{
  const PetscReal *n = links->direction + dim * l, *a = links->U + dim * (links->ends[2 * l] - links->first), *b = links->U + dim * (links->ends[2 * l + 1] - links->first);
  PetscReal        e = 0.0;

  for (PetscInt c = 0; c < dim; c++) e += n[c] * (b[c] - a[c]);
  return e;
}

/* Computes g = F - B^t (s + l e) of subdomain s, with the tensions (26) of the links; s = k e0 of links without state */
LATIN_INLINE void LatinLinksForces(const LatinLinear *linear, const PetscInt dim, PetscInt s, const PetscReal z[])
{
  const LatinLinks links = LatinLinksOpen(linear, dim, s);
  const PetscInt   first = dim * linear->sub->node_offset[s], last = dim * linear->sub->node_offset[s + 1];
  PetscReal       *g = linear->g + first;

  for (PetscInt i = first; i < last; i++) linear->g[i] = linear->load[i];
  for (PetscInt l = 0; l < links.links; l++) {
    const PetscReal k = links.stiffness[l], *n = links.direction + dim * l, e = LatinLinksElongation(&links, dim, l);
    const PetscReal t = (links.state[l] >= 0 ? z[links.state[l]] : LatinBarLocal(k, links.e0[l])) + k * e;
    PetscReal      *a = g + dim * (links.ends[2 * l] - links.first), *b = g + dim * (links.ends[2 * l + 1] - links.first);

    for (PetscInt c = 0; c < dim; c++) {
      a[c] += t * n[c];
      b[c] -= t * n[c];
    }
  }
}

/*
   Performs the local stage of subdomain s. Adds to sum: the squared distance; the energy of elongations under tension; the same with initial elongations.
   Only bars, cables and compression-only links; for other laws see stages/localcontacts.c.
*/
LATIN_INLINE void LatinLinksStage(const LatinLinear *linear, const PetscInt dim, PetscInt s, const PetscReal z[], PetscReal next[], PetscReal sum[3])
{
  const LatinLinks links    = LatinLinksOpen(linear, dim, s);
  PetscReal        distance = 0.0, energy = 0.0, noise = 0.0;

  for (PetscInt l = 0; l < links.links; l++) {
    const PetscInt  i = links.state[l];
    const PetscReal k = links.stiffness[l], e0 = links.e0[l], e = LatinLinksElongation(&links, dim, l), whole = PetscAbsReal(e), strain = PetscAbsReal(e + e0);
    PetscReal       old, new, taut;

    if (i < 0) {
      energy += k * e * e;
      noise += k * strain * strain;
      continue;
    }
    old = z[i];
    new = LatinUnilateralLocal(LatinLawSign(links.law[l]), k, e0, old + 2.0 * k * e);
    /* a slack link stores no energy; the energy decreases continuously as it slackens, so that rounding does not matter */
    taut = new == k *e0 ? (strain < whole ? strain : whole) : 0.0;
    distance += (new - old) * (new - old) * (0.25 / k);
    energy += k * whole * taut;
    noise += taut > 0.0 ? k * strain * strain : 0.0;
    next[i] = new;
  }
  sum[0] += distance;
  sum[1] += energy;
  sum[2] += noise;
}

/* Performs the local stage, or computes the forces if sum is NULL. No test of z or next: both may be NULL, on a rank without interfaces and states */
LATIN_INLINE void LatinSweep(const LatinLinear *linear, const PetscInt dim, const PetscReal z[], PetscReal next[], PetscReal sum[3])
{
  for (PetscInt s = 0; s < linear->sub->n; s++) {
    if (sum) LatinLinksStage(linear, dim, s, z, next, sum);
    else LatinLinksForces(linear, dim, s, z);
  }
}

/* Computes linear->g = F - B^t (s + l e) in all subdomains here, with the states z of the links and the displacements linear->U */
LATIN_CLONES void LatinSweepForces(const LatinLinear *linear, const PetscReal z[])
{
  if (linear->sub->structure->dim == 3) LatinSweep(linear, 3, z, NULL, NULL);
  else if (linear->sub->structure->dim == 2) LatinSweep(linear, 2, z, NULL, NULL);
  else LatinSweep(linear, 1, z, NULL, NULL);
}

/* Performs the local stage of all links here. Adds to sum, see LatinLinksStage() */
LATIN_CLONES void LatinSweepStage(const LatinLinear *linear, const PetscReal z[], PetscReal next[], PetscReal sum[3])
{
  if (linear->sub->structure->dim == 3) LatinSweep(linear, 3, z, next, sum);
  else if (linear->sub->structure->dim == 2) LatinSweep(linear, 2, z, next, sum);
  else LatinSweep(linear, 1, z, next, sum);
}
