#include "error/latinerror.h"

/*
   Nodal balance: forces of links at each node and their rounding, the resistance of links against the unbalance, and the distances by which rigid
   links miss their gaps. Nodes are passed to error/equilibrium.c one by one: all of them at once would be the largest array of a solve.
*/

#define LATIN_NODAL_PIECES 8     /* pieces of the vertices, processed in turn; each takes a pass over the links */
#define LATIN_STICKS       0.999 /* a contact sticks below this part of its Coulomb limit */
#define LATIN_GAP_NOISE    4.0   /* times eps, and displacements and gap of a link: rounding of its elongation */

/* Local vectors: displacements, 1 at free dofs, unbalance, loads, springs to the ground */
enum { LATIN_AT_U, LATIN_AT_FREE, LATIN_AT_R, LATIN_AT_LOAD, LATIN_AT_GROUND, LATIN_AT };

/* Scatters the vectors of a check to the vertices here. Collective on structure */
static PetscErrorCode LatinNodalGet_Private(LatinStructure structure, Vec u, Vec r, Vec more, Vec local[])
{
  Vec work;

  PetscFunctionBegin;
  for (PetscInt i = 0; i < LATIN_AT; i++) PetscCall(DMGetLocalVector(structure->dm, &local[i]));
  PetscCall(DMGetGlobalVector(structure->dm, &work));
  PetscCall(LatinStructureGetLocal_Private(structure, structure->vertex_prescribed, u, local[LATIN_AT_U]));
  PetscCall(VecSet(work, 1.0));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, work, local[LATIN_AT_FREE]));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, r, local[LATIN_AT_R]));
  PetscCall(VecCopy(structure->load, work));
  if (more) PetscCall(VecAXPY(work, 1.0, more));
  PetscCall(LatinStructureGetLocal_Private(structure, NULL, work, local[LATIN_AT_LOAD]));
  if (structure->ground) PetscCall(LatinStructureGetLocal_Private(structure, NULL, structure->ground, local[LATIN_AT_GROUND]));
  else PetscCall(VecZeroEntries(local[LATIN_AT_GROUND]));
  PetscCall(DMRestoreGlobalVector(structure->dm, &work));
  PetscFunctionReturn(0);
}

/* Returns the distance by which rigid link l misses its gap, beyond rounding. x: its strain; moved: sum of the absolute displacements of its ends along it */
static PetscReal LatinGapMissed(Latin latin, PetscInt l, PetscReal x, PetscReal moved)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscReal      tension = latin->linear.rigid_tension[l], noise = LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * (PetscAbsReal(structure->e0[l]) + moved);
  PetscReal            missed = 0.0;

  if (structure->law[l] == LATIN_LAW_TANGENT) {
    PetscInt  normal = l;
    PetscReal size   = 0.0;

    while (structure->law[normal] == LATIN_LAW_TANGENT) normal--;
    for (PetscInt c = normal + 1; c < normal + structure->dim; c++) size += PetscSqr(latin->linear.rigid_tension[c]);
    if (PetscSqrtReal(size) < -LATIN_STICKS * structure->friction[normal] * latin->linear.rigid_tension[normal]) missed = PetscAbsReal(x); /* it sticks */
  } else if (tension != 0.0) missed = PetscAbsReal(x);
  else missed = PetscMax(0.0, LatinLawSign(structure->law[l]) * x);
  return PetscMax(0.0, missed - noise);
}

/* Returns the resistance of link l to a motion of one of its ends that strains it at this rate: 1 / displacement at which it balances the force `push` */
static PetscReal LatinResistance(Latin latin, PetscInt l, PetscReal x, PetscReal rate, PetscReal push)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscInt       law       = structure->law[l];
  const PetscReal      k = latin->sub.link_stiffness[l], sign = LatinLawSign(law);
  PetscReal            closing;

  if (law == LATIN_LAW_TANGENT) return latin->linear.rigid_tension[l] != 0.0 ? k * rate * rate / push : 0.0;
  if (law > LATIN_LAW_TANGENT) return LatinStructureTangent(structure, l, x) * rate * rate / push;
  if (law == LATIN_LAW_BAR) return k * rate * rate / push;
  closing = PetscMax(0.0, sign * rate);
  return sign * x < 0.0 ? closing / PetscAbsReal(x) : k * closing * closing / push;
}

/*
   Adds a link along the displacement of one of its ends. If rounding hides whether the link bears, its tension does not count, and the direction that
   would strain it is closed; a rigid link that bears or touches closes both directions.

     own:   elongation by this displacement
     each:  sum of the absolute elongations by its components; a link orthogonal to it does not hold
     whole: sum of its absolute components
     reach: magnitude of the rounded numbers
*/
static void LatinNodalAlong(Latin latin, PetscInt l, PetscReal x, PetscReal tension, PetscReal reach, PetscReal own, PetscReal each, PetscReal whole, LatinNode *at)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscReal      sign      = LatinLawSign(structure->law[l]);
  const PetscReal      noise     = LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * reach;
  const PetscBool      rigid = LatinLaws[structure->law[l]].rigid, touches = (PetscBool)(PetscAbsReal(x) <= noise);

  if (!LatinLaws[structure->law[l]].smooth && (touches || (rigid && tension != 0.0))) {
    at->slack -= tension * own;
    if (sign * own > 0.0 || (rigid && own != 0.0)) at->closed[0] += 1.0;
    if (sign * own < 0.0 || (rigid && own != 0.0)) at->closed[1] += 1.0;
  } else if (!rigid && LatinStructureTangent(structure, l, x) > 0.0 && PetscAbsReal(own) > LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * whole) {
    at->held += 2.0 * LatinStructureTangent(structure, l, x) * PetscSqr(own);
    /* rounding of the elongation, and of each component of the force */
    at->hides += noise * latin->sub.link_stiffness[l] * PetscAbsReal(own) + LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * PetscAbsReal(tension) * each;
    at->turns += PetscMax(0.0, PetscAbsReal(tension) - noise * latin->sub.link_stiffness[l]) * each;
  }
}

/* Adds a link to the sums over links. moved: its elongation by the free displacements; ends: sum of the absolute displacements of its ends along it */
static void LatinNodalSum(LatinNodalBalance *balance, PetscInt l, PetscReal x, PetscReal e, PetscReal tension, PetscReal moved, PetscReal ends)
{
  const LatinStructure structure = balance->latin->sub.structure;
  const PetscReal      k         = balance->latin->sub.link_stiffness[l];
  PetscReal            missed;

  balance->sum.energy += k * e * e;
  balance->sum.work += tension * PetscAbsReal(moved);
  if (!LatinLaws[structure->law[l]].rigid) return;
  missed       = LatinGapMissed(balance->latin, l, x, ends);
  balance->gap = PetscMax(balance->gap, missed);
  if (tension == 0.0 && missed == 0.0) return;
  balance->sum.bearing_moves += PetscSqr(tension / k);
  balance->sum.bearing_gaps += PetscSqr(structure->e0[l]);
}

/* Adds a link to those of its ends that are vertices first to last - 1, and to the sums over links if its first end is one of them. a: local vectors */
static void LatinNodalAddLink(LatinNodalBalance *balance, PetscInt l, PetscScalar *const a[], PetscReal target, PetscInt first, PetscInt last, LatinNode vertex[])
{
  const Latin          latin     = balance->latin;
  const LatinStructure structure = latin->sub.structure;
  const PetscInt       dim = structure->dim, *to = structure->ends + 2 * l;
  const PetscBool      rigid = LatinLaws[structure->law[l]].rigid;
  const PetscReal     *n = structure->direction + dim * l, k = latin->sub.link_stiffness[l], e0 = PetscAbsReal(structure->e0[l]);
  const PetscReal      e = LatinStructureElongation(structure, l, a[LATIN_AT_U]), x = e + structure->e0[l], bears = LatinStructureTension(structure, latin->linear.rigid_tension, l, x), tension = PetscAbsReal(bears);
  /* moves: elongations by unit translations and by the free displacements; certain, possible: least and greatest stiffness at an error of the target */
  PetscReal all = 0.0, ends = 0.0, moves[4] = {0.0, 0.0, 0.0, 0.0}, certain = k, possible = k;

  for (PetscInt c = 0; c < dim; c++) {
    const PetscScalar *u = a[LATIN_AT_U] + c, *open = a[LATIN_AT_FREE] + c;

    all += PetscAbsReal(n[c]);
    ends += PetscAbsReal(n[c]) * (PetscAbsScalar(u[dim * to[0]]) + PetscAbsScalar(u[dim * to[1]]));
    moves[c] = n[c] * (open[dim * to[1]] - open[dim * to[0]]);
    moves[3] += n[c] * (open[dim * to[1]] * u[dim * to[1]] - open[dim * to[0]] * u[dim * to[0]]);
  }
  if (!rigid) {
    const PetscReal low = LatinStructureTangent(structure, l, x - target * (e0 + ends)), high = LatinStructureTangent(structure, l, x + target * (e0 + ends));

    certain = PetscMin(low, high);
    if (structure->ground) possible = PetscMax(low, high); /* free bodies have only masses */
  } else if (structure->ground && structure->law[l] != LATIN_LAW_TANGENT && tension == 0.0 && LatinLawSign(structure->law[l]) * x < -target * (e0 + ends)) possible = 0.0;
  if (to[0] >= first && to[0] < last) LatinNodalSum(balance, l, x, e, tension, moves[3], ends);
  for (PetscInt i = 0; i < 2; i++) {
    const PetscScalar *r = a[LATIN_AT_R] + dim * to[i];
    /* own: elongation by the displacement of this end; each: sum of absolute values over its components */
    PetscReal  along = 0.0, push = 0.0, own = 0.0, each = 0.0, whole = 0.0;
    LatinNode *at;

    if (to[i] < first || to[i] >= last) continue;
    at = &vertex[to[i] - first];
    for (PetscInt c = 0; c < dim; c++) {
      const PetscReal cosine = PetscAbsReal(n[c]);

      own += (i ? n[c] : -n[c]) * PetscRealPart(a[LATIN_AT_FREE][dim * to[i] + c] * a[LATIN_AT_U][dim * to[i] + c]);
      whole += PetscAbsScalar(a[LATIN_AT_FREE][dim * to[i] + c] * a[LATIN_AT_U][dim * to[i] + c]);
      each += cosine * PetscAbsScalar(a[LATIN_AT_FREE][dim * to[i] + c] * a[LATIN_AT_U][dim * to[i] + c]);
      at->stiffness[c] += 2.0 * possible * cosine * all;
      /* a gap exerts no force, and is infinite if a contact is not active in a step */
      at->rounding[c] += cosine * (k * (ends + (rigid ? 0.0 : e0)) + (rigid || structure->law[l] > LATIN_LAW_TANGENT ? tension : 0.0));
      for (PetscInt d = 0; d < dim; d++) at->translation[3 * d + c] += k * cosine * PetscAbsReal(moves[d]);
      at->tangent[c] += certain * cosine * PetscAbsReal(moves[3]);
      if (rigid) at->rigid[c] += (i ? n[c] : -n[c]) * bears;
      along -= (i ? n[c] : -n[c]) * PetscRealPart(r[c]);
      push += PetscSqr(PetscRealPart(r[c]));
    }
    push = PetscSqrtReal(push);
    at->tension += tension;
    at->bearing += rigid ? 0.0 : tension;
    at->gaps += k * (ends + (rigid && structure->ground ? 0.0 : e0)) + tension;
    LatinNodalAlong(latin, l, x, bears, e0 + ends, own, each, whole, at);
    if (push > 0.0) at->resistance += LatinResistance(latin, l, x, along / push, push);
  }
}

/* Sets displacements, unbalance, load and springs of a vertex */
static void LatinNodalVertex(PetscInt dim, PetscInt v, PetscScalar *const a[], LatinNode *at)
{
  at->vertices = 1.0;
  for (PetscInt c = 0, i = dim * v; c < dim; c++, i++) {
    at->u[c]      = PetscRealPart(a[LATIN_AT_FREE][i] * a[LATIN_AT_U][i]);
    at->r[c]      = PetscRealPart(a[LATIN_AT_R][i]);
    at->load[c]   = PetscRealPart(a[LATIN_AT_LOAD][i]);
    at->ground[c] = PetscRealPart(a[LATIN_AT_GROUND][i]);
  }
}

/* Visits a node after all sums over its vertices */
static void LatinNodalFinish(LatinNode *at, PetscInt number, LatinNodeVisit *visit, void *ctx)
{
  at->bearing += PetscSqrtReal(PetscSqr(at->rigid[0]) + PetscSqr(at->rigid[1]) + PetscSqr(at->rigid[2]));
  for (PetscInt c = 0; c < 3 && at->vertices > 1.0; c++) {
    at->u[c] /= at->vertices;
    at->r[c] /= at->vertices;
    at->load[c] /= at->vertices;
    at->ground[c] /= at->vertices;
  }
  visit(at, number, ctx);
}

/* Visits the nodes shared by ranks, on their owners. Collective on structure */
static PetscErrorCode LatinNodalShared_Private(LatinStructure structure, const PetscInt number[], LatinNode shared[], LatinNodeVisit *visit, void *ctx)
{
  const PetscInt *leaf;
  PetscInt        leaves;

  PetscFunctionBegin;
  if (!structure->shared_sf) PetscFunctionReturn(0);
  PetscCall(LatinSFReduce_Private(structure->shared_sf, sizeof(LatinNode) / sizeof(PetscReal), MPIU_REAL, shared, shared, MPI_SUM));
  PetscCall(PetscSFGetGraph(structure->shared_sf, NULL, &leaves, &leaf, NULL));
  for (PetscInt k = 0; k < leaves; k++) shared[leaf ? leaf[k] : k].vertices = 0.0; /* owned by another rank */
  for (PetscInt k = 0; k < structure->shared; k++)
    if (shared[k].vertices > 0.0) LatinNodalFinish(&shared[k], number[structure->shared_vertex[k]], visit, ctx);
  PetscFunctionReturn(0);
}

/* Sets the global numbers of the nodes of the vertices of this rank. Collective on structure */
static PetscErrorCode LatinNodalNumbers_Private(LatinStructure structure, PetscInt number[])
{
  PetscInt *own;

  PetscFunctionBegin;
  PetscCall(PetscMalloc1(structure->nodes_local, &own));
  for (PetscInt i = 0; i < structure->nodes_local; i++) own[i] = structure->nodes_start + i;
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, 1, MPIU_INT, own, number));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(0);
}

/*
   Visits each node once, on one of its ranks, for displacements u with the unbalance r. more: an additional load, or NULL. LatinNode.tangent is of
   links that bear at any relative error of u up to `target`. Collective on structure
*/
PetscErrorCode LatinNodalBalance_Private(Latin latin, Vec u, Vec r, Vec more, PetscReal target, LatinNodeVisit *visit, void *ctx, LatinNodalBalance *balance)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscInt       dim = structure->dim, piece = structure->vertices / LATIN_NODAL_PIECES + 1;
  PetscScalar         *a[LATIN_AT];
  PetscInt            *number, k = 0;
  LatinNode           *vertex, *shared;
  Vec                  local[LATIN_AT];

  PetscFunctionBegin;
  *balance = (LatinNodalBalance){.latin = latin};
  PetscCall(PetscMalloc3(piece, &vertex, structure->shared, &shared, structure->vertices, &number));
  PetscCall(LatinNodalNumbers_Private(structure, number));
  PetscCall(LatinNodalGet_Private(structure, u, r, more, local));
  for (PetscInt i = 0; i < LATIN_AT; i++) PetscCall(VecGetArray(local[i], &a[i]));
  for (PetscInt first = 0; first < structure->vertices; first += piece) {
    const PetscInt last = PetscMin(first + piece, structure->vertices);

    PetscCall(PetscArrayzero(vertex, last - first));
    for (PetscInt l = 0; l < structure->links_local; l++) {
      const PetscInt *to = structure->ends + 2 * l;

      if ((to[0] >= first && to[0] < last) || (to[1] >= first && to[1] < last)) LatinNodalAddLink(balance, l, a, target, first, last, vertex);
    }
    for (PetscInt v = first; v < last; v++) {
      LatinNodalVertex(dim, v, a, &vertex[v - first]);
      if (k < structure->shared && structure->shared_vertex[k] == v) shared[k++] = vertex[v - first];
      else LatinNodalFinish(&vertex[v - first], number[v], visit, ctx);
    }
  }
  for (PetscInt i = 0; i < LATIN_AT; i++) {
    PetscCall(VecRestoreArray(local[i], &a[i]));
    PetscCall(DMRestoreLocalVector(structure->dm, &local[i]));
  }
  PetscCall(LatinNodalShared_Private(structure, number, shared, visit, ctx));
  PetscCall(PetscFree3(vertex, shared, number));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &balance->sum, sizeof(balance->sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &balance->gap, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}
