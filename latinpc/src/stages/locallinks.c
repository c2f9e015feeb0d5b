#include "stages/latinstages.h"
#include "base/vector.h"

/*
   The two sweeps of an iteration over the links, forces and local stage. Equal subdomains (localsolvers/batches.c) are the lanes of
   vector instructions: ends, directions and stiffnesses are read once for all of them, displacements and forces are in
   tiles [dof][lane]. With one lane the tiles are the arrays over copies themselves. dim and lanes are compile-time constants
   in the callers, so that loops unroll.
*/

#define LATIN_FOR_LANES(w) _Pragma("omp simd") for (PetscInt w = 0; w < lanes; w++)

/* The links of equal subdomains: common data, and pointers to those of each lane */
typedef struct {
  PetscInt         links, rows;
  const PetscInt  *ends;                             /* [links][2] copies */
  PetscInt         first;                            /* the first copy */
  const PetscReal *direction, *stiffness;            /* [links][dim], [links] */
  const PetscInt  *law, *state;                      /* [links] of the first subdomain */
  const PetscReal *e0[LATIN_LANES], *z[LATIN_LANES]; /* [links]; states, at state[l] */
  const PetscReal *U;                                /* tile of displacements */
} LatinTile;

LATIN_INLINE void LatinTileRead(const PetscInt lanes, PetscInt rows, const PetscReal *const from[], PetscReal tile[])
{
  for (PetscInt r = 0; r < rows; r++)
    LATIN_FOR_LANES (w) tile[lanes * r + w] = from[w][r];
}

LATIN_INLINE void LatinTileWrite(const PetscInt lanes, PetscInt rows, const PetscReal tile[], PetscReal *const to[])
{
  for (PetscInt r = 0; r < rows; r++)
    LATIN_FOR_LANES (w) to[w][r] = tile[lanes * r + w];
}

LATIN_INLINE LatinTile LatinTileOpen(const LatinLinear *linear, const PetscInt dim, const PetscInt lanes, const PetscInt member[], const PetscReal z[])
{
  const LatinSubdomains *sub = linear->sub;
  const PetscInt         s = member[0], r = linear->batches->pattern[s];
  LatinTile              tile;

  tile.links     = sub->link_offset[r + 1] - sub->link_offset[r];
  tile.rows      = dim * (sub->node_offset[r + 1] - sub->node_offset[r]);
  tile.first     = sub->node_offset[r];
  tile.ends      = sub->ends + 2 * sub->link_offset[r];
  tile.direction = sub->direction + dim * sub->link_offset[r];
  tile.stiffness = sub->stiffness + sub->link_offset[r];
  tile.law       = sub->law + sub->link_offset[s];
  tile.state     = sub->state + sub->link_offset[s];
  for (PetscInt w = 0; w < lanes; w++) {
    tile.e0[w] = sub->e0 + sub->link_offset[member[w]];
    tile.z[w]  = z + sub->state_first[member[w]] - sub->state_first[s];
  }
  if (lanes == 1) tile.U = linear->U + dim * sub->node_offset[s];
  else {
    const PetscReal *from[LATIN_LANES];

    for (PetscInt w = 0; w < lanes; w++) from[w] = linear->U + dim * sub->node_offset[member[w]];
    LatinTileRead(lanes, tile.rows, from, linear->tile);
    tile.U = linear->tile;
  }
  return tile;
}

/* The elongations of one link, a row of B */
LATIN_INLINE void LatinTileElongation(const LatinTile *tile, const PetscInt dim, const PetscInt lanes, PetscInt l, PetscReal e[])
{
  const PetscReal *n = tile->direction + dim * l, *a = tile->U + dim * lanes * (tile->ends[2 * l] - tile->first), *b = tile->U + dim * lanes * (tile->ends[2 * l + 1] - tile->first);

  LATIN_FOR_LANES (w) e[w] = 0.0;
  for (PetscInt c = 0; c < dim; c++)
    LATIN_FOR_LANES (w) e[w] += n[c] * (b[lanes * c + w] - a[lanes * c + w]);
}

/* g = F - B^t (s + l e), with the tensions (26) of the links; s = k e0 of links without state */
LATIN_INLINE void LatinTileForces(const LatinLinear *linear, const PetscInt dim, const PetscInt lanes, const PetscInt member[], const PetscReal z[])
{
  const LatinTile  tile = LatinTileOpen(linear, dim, lanes, member, z);
  const PetscReal *load[LATIN_LANES];
  PetscReal       *to[LATIN_LANES], *g;

  for (PetscInt w = 0; w < lanes; w++) {
    load[w] = linear->load + dim * linear->sub->node_offset[member[w]];
    to[w]   = linear->g + dim * linear->sub->node_offset[member[w]];
  }
  g = lanes == 1 ? to[0] : linear->tile + lanes * tile.rows;
  LatinTileRead(lanes, tile.rows, load, g);
  for (PetscInt l = 0; l < tile.links; l++) {
    const PetscReal k = tile.stiffness[l], *n = tile.direction + dim * l;
    PetscReal      *a = g + dim * lanes * (tile.ends[2 * l] - tile.first), *b = g + dim * lanes * (tile.ends[2 * l + 1] - tile.first);
    PetscReal       e[LATIN_LANES], t[LATIN_LANES];

    LatinTileElongation(&tile, dim, lanes, l, e);
    if (tile.state[l] >= 0)
      LATIN_FOR_LANES (w) t[w] = tile.z[w][tile.state[l]];
    else
      LATIN_FOR_LANES (w) t[w] = LatinBarLocal(k, tile.e0[w][l]);
    LATIN_FOR_LANES (w) t[w] += k * e[w];
    for (PetscInt c = 0; c < dim; c++) {
      LATIN_FOR_LANES (w) a[lanes * c + w] += t[w] * n[c];
      LATIN_FOR_LANES (w) b[lanes * c + w] -= t[w] * n[c];
    }
  }
  if (lanes > 1) LatinTileWrite(lanes, tile.rows, g, to);
}

/*
   The local stage. Adds to sum: the squared distance; the energy of elongations under tension; the same with initial
   elongations. Only bars, cables and compression-only links; for other laws see stages/localcontacts.c.
*/
LATIN_INLINE void LatinTileStage(const LatinLinear *linear, const PetscInt dim, const PetscInt lanes, const PetscInt member[], const PetscReal z[], PetscReal next[], PetscReal sum[3])
{
  const LatinTile tile                  = LatinTileOpen(linear, dim, lanes, member, z);
  PetscReal       distance[LATIN_LANES] = {0.0}, energy[LATIN_LANES] = {0.0}, noise[LATIN_LANES] = {0.0}, *to[LATIN_LANES];

  for (PetscInt w = 0; w < lanes; w++) to[w] = next + (tile.z[w] - z);
  for (PetscInt l = 0; l < tile.links; l++) {
    const PetscReal k    = tile.stiffness[l];
    const PetscReal sign = LatinLawSign(tile.law[l]);
    const PetscInt  i    = tile.state[l];
    PetscReal       e[LATIN_LANES], e0[LATIN_LANES], old[LATIN_LANES], new[LATIN_LANES];

    LatinTileElongation(&tile, dim, lanes, l, e);
    LATIN_FOR_LANES (w) e0[w] = tile.e0[w][l];
    if (i < 0) {
      LATIN_FOR_LANES (w) {
        energy[w] += k * e[w] * e[w];
        noise[w] += k * (e[w] + e0[w]) * (e[w] + e0[w]);
      }
      continue;
    }
    LATIN_FOR_LANES (w) old[w] = tile.z[w][i];
    LATIN_FOR_LANES (w) new[w] = LatinUnilateralLocal(sign, k, e0[w], old[w] + 2.0 * k * e[w]);
    LATIN_FOR_LANES (w) {
      /* a slack link stores no energy; the energy decreases continuously as it slackens, so that rounding does not matter */
      const PetscReal whole = PetscAbsReal(e[w]), strain = PetscAbsReal(e[w] + e0[w]), taut = new[w] == k *e0[w] ? (strain < whole ? strain : whole) : 0.0;

      distance[w] += (new[w] - old[w]) * (new[w] - old[w]) * (0.25 / k);
      energy[w] += k * whole * taut;
      noise[w] += taut > 0.0 ? k * strain * strain : 0.0;
    }
    LATIN_FOR_LANES (w) to[w][i] = new[w];
  }
  for (PetscInt w = 0; w < lanes; w++) {
    sum[0] += distance[w];
    sum[1] += energy[w];
    sum[2] += noise[w];
  }
}

/* The local stage, or the forces if sum is NULL. No test of z or next: both may be NULL, on a rank without interfaces and states */
LATIN_INLINE void LatinSweep(const LatinLinear *linear, const PetscInt dim, const PetscReal z[], PetscReal next[], PetscReal sum[3])
{
  for (PetscInt b = 0; b < linear->batches->n; b++) {
    const LatinBatch *batch = &linear->batches->batch[b];
    const PetscInt    n     = batch->members;
    PetscInt          m     = 0;

    for (; batch->alike && m + LATIN_LANES <= n; m += LATIN_LANES) {
      if (sum) LatinTileStage(linear, dim, LATIN_LANES, batch->sub + m, z, next, sum);
      else LatinTileForces(linear, dim, LATIN_LANES, batch->sub + m, z);
    }
    for (; m < n; m++) {
      if (sum) LatinTileStage(linear, dim, 1, batch->sub + m, z, next, sum);
      else LatinTileForces(linear, dim, 1, batch->sub + m, z);
    }
  }
}

/* linear.g = F - B^t (s + l e) in all subdomains here, with the states z of the links and the displacements linear.U */
LATIN_CLONES void LatinSweepForces(const LatinLinear *linear, const PetscReal z[])
{
  if (linear->sub->structure->dim == 3) LatinSweep(linear, 3, z, NULL, NULL);
  else if (linear->sub->structure->dim == 2) LatinSweep(linear, 2, z, NULL, NULL);
  else LatinSweep(linear, 1, z, NULL, NULL);
}

/* The local stage of all links here; adds to sum, see LatinTileStage() */
LATIN_CLONES void LatinSweepStage(const LatinLinear *linear, const PetscReal z[], PetscReal next[], PetscReal sum[3])
{
  if (linear->sub->structure->dim == 3) LatinSweep(linear, 3, z, next, sum);
  else if (linear->sub->structure->dim == 2) LatinSweep(linear, 2, z, next, sum);
  else LatinSweep(linear, 1, z, next, sum);
}
