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

/* A link at the displacements of a check */
typedef struct {
  PetscInt  number, law;
  PetscBool rigid;
  PetscReal k, e, x;           /* stiffness, elongation, strain e + e0 */
  PetscReal bears, tension;    /* tension, and its absolute value */
  PetscReal gap, ends;         /* |e0|; sum of the absolute displacements of its ends along it: their sum is the magnitude of the rounded numbers */
  PetscReal all;               /* sum of the absolute components of its direction */
  PetscReal moves[4];          /* elongations by unit translations, and by the free displacements */
  PetscReal certain, possible; /* least and greatest stiffness at an error of the target */
} LatinNodalLink;

/* Sets the least and greatest stiffness of a link at any relative error of u up to `target` */
static void LatinNodalStiffness(LatinStructure structure, PetscReal target, LatinNodalLink *link)
{
  const PetscReal error = target * (link->gap + link->ends);

  link->certain = link->possible = link->k;
  if (!link->rigid) {
    const PetscReal low = LatinStructureTangent(structure, link->number, link->x - error), high = LatinStructureTangent(structure, link->number, link->x + error);

    link->certain = PetscMin(low, high);
    if (structure->ground) link->possible = PetscMax(low, high); /* free bodies have only masses */
  } else if (structure->ground && link->law != LATIN_LAW_TANGENT && link->tension == 0.0 && LatinLawSign(link->law) * link->x < -error) link->possible = 0.0;
}

/* Computes the state of link l. a: local vectors */
static void LatinNodalGetLink(Latin latin, PetscInt l, PetscScalar *const a[], PetscReal target, LatinNodalLink *link)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscInt       dim = structure->dim, *to = structure->ends + 2 * l;
  const PetscReal     *n = structure->direction + dim * l;

  *link         = (LatinNodalLink){.number = l, .law = structure->law[l], .rigid = LatinLaws[structure->law[l]].rigid, .k = latin->sub.link_stiffness[l], .gap = PetscAbsReal(structure->e0[l])};
  link->e       = LatinStructureElongation(structure, l, a[LATIN_AT_U]);
  link->x       = link->e + structure->e0[l];
  link->bears   = LatinStructureTension(structure, latin->linear.rigid_tension, l, link->x);
  link->tension = PetscAbsReal(link->bears);
  for (PetscInt c = 0; c < dim; c++) {
    const PetscScalar *u = a[LATIN_AT_U] + c, *open = a[LATIN_AT_FREE] + c;

    link->all += PetscAbsReal(n[c]);
    link->ends += PetscAbsReal(n[c]) * (PetscAbsScalar(u[dim * to[0]]) + PetscAbsScalar(u[dim * to[1]]));
    link->moves[c] = n[c] * (open[dim * to[1]] - open[dim * to[0]]);
    link->moves[3] += n[c] * (open[dim * to[1]] * u[dim * to[1]] - open[dim * to[0]] * u[dim * to[0]]);
  }
  LatinNodalStiffness(structure, target, link);
}

/* Returns the distance by which a rigid link misses its gap, beyond rounding */
static PetscReal LatinGapMissed(Latin latin, const LatinNodalLink *link)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscReal     *tension = latin->linear.rigid_tension, noise = LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * (link->gap + link->ends);
  PetscReal            missed = 0.0;

  if (link->law == LATIN_LAW_TANGENT) {
    PetscInt  normal = link->number;
    PetscReal size   = 0.0;

    while (structure->law[normal] == LATIN_LAW_TANGENT) normal--;
    for (PetscInt c = normal + 1; c < normal + structure->dim; c++) size += PetscSqr(tension[c]);
    if (PetscSqrtReal(size) < -LATIN_STICKS * structure->friction[normal] * tension[normal]) missed = PetscAbsReal(link->x); /* it sticks */
  } else if (tension[link->number] != 0.0) missed = PetscAbsReal(link->x);
  else missed = PetscMax(0.0, LatinLawSign(link->law) * link->x);
  return PetscMax(0.0, missed - noise);
}

/* Returns the resistance of a link to a motion of one of its ends that strains it at this rate: 1 / displacement at which it balances the force `push` */
static PetscReal LatinResistance(Latin latin, const LatinNodalLink *link, PetscReal rate, PetscReal push)
{
  const PetscReal sign = LatinLawSign(link->law);
  PetscReal       closing;

  if (link->law == LATIN_LAW_TANGENT) return latin->linear.rigid_tension[link->number] != 0.0 ? link->k * rate * rate / push : 0.0;
  if (link->law > LATIN_LAW_TANGENT) return LatinStructureTangent(latin->sub.structure, link->number, link->x) * rate * rate / push;
  if (link->law == LATIN_LAW_BAR) return link->k * rate * rate / push;
  closing = PetscMax(0.0, sign * rate);
  return sign * link->x < 0.0 ? closing / PetscAbsReal(link->x) : link->k * closing * closing / push;
}

/* Displacement of one end of a link */
typedef struct {
  PetscReal own;   /* elongation by it */
  PetscReal each;  /* sum of the absolute elongations by its components; a link orthogonal to it does not hold */
  PetscReal whole; /* sum of its absolute components */
} LatinNodalMotion;

/*
   Adds a link along the displacement of one of its ends. If rounding hides whether the link bears, its tension does not count, and the direction that
   would strain it is closed; a rigid link that bears or touches closes both directions
*/
static void LatinNodalAlong(LatinStructure structure, const LatinNodalLink *link, const LatinNodalMotion *motion, LatinNode *at)
{
  const PetscReal sign    = LatinLawSign(link->law);
  const PetscReal noise   = LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * (link->gap + link->ends);
  const PetscBool touches = (PetscBool)(PetscAbsReal(link->x) <= noise);

  if (!LatinLaws[link->law].smooth && (touches || (link->rigid && link->bears != 0.0))) {
    at->slack -= link->bears * motion->own;
    if (sign * motion->own > 0.0 || (link->rigid && motion->own != 0.0)) at->closed[0] += 1.0;
    if (sign * motion->own < 0.0 || (link->rigid && motion->own != 0.0)) at->closed[1] += 1.0;
  } else if (!link->rigid && LatinStructureTangent(structure, link->number, link->x) > 0.0 && PetscAbsReal(motion->own) > LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * motion->whole) {
    at->held += 2.0 * LatinStructureTangent(structure, link->number, link->x) * PetscSqr(motion->own);
    /* rounding of the elongation, and of each component of the force */
    at->hides += noise * link->k * PetscAbsReal(motion->own) + LATIN_GAP_NOISE * PETSC_MACHINE_EPSILON * link->tension * motion->each;
    at->turns += PetscMax(0.0, link->tension - noise * link->k) * motion->each;
  }
}

/* Adds a link to the sums over links */
static void LatinNodalSum(LatinNodalBalance *balance, const LatinNodalLink *link)
{
  PetscReal missed;

  balance->sum.energy += link->k * link->e * link->e;
  balance->sum.work += link->tension * PetscAbsReal(link->moves[3]);
  if (!link->rigid) return;
  missed       = LatinGapMissed(balance->latin, link);
  balance->gap = PetscMax(balance->gap, missed);
  if (link->tension == 0.0 && missed == 0.0) return;
  balance->sum.bearing_moves += PetscSqr(link->tension / link->k);
  balance->sum.bearing_gaps += PetscSqr(link->gap);
}

/* Adds a link to its first (end 0) or second node */
static void LatinNodalAddEnd(Latin latin, const LatinNodalLink *link, PetscInt end, PetscScalar *const a[], LatinNode *at)
{
  const LatinStructure structure = latin->sub.structure;
  const PetscInt       dim = structure->dim, vertex = structure->ends[2 * link->number + end];
  const PetscReal     *n     = structure->direction + dim * link->number;
  PetscReal            along = 0.0, push = 0.0; /* the unbalance: along the link, and its norm */
  LatinNodalMotion     motion = {0.0, 0.0, 0.0};

  for (PetscInt c = 0; c < dim; c++) {
    const PetscReal cosine = PetscAbsReal(n[c]), out = end ? n[c] : -n[c];
    const PetscReal r = PetscRealPart(a[LATIN_AT_R][dim * vertex + c]), u = PetscRealPart(a[LATIN_AT_FREE][dim * vertex + c] * a[LATIN_AT_U][dim * vertex + c]);

    motion.own += out * u;
    motion.whole += PetscAbsReal(u);
    motion.each += cosine * PetscAbsReal(u);
    at->stiffness[c] += 2.0 * link->possible * cosine * link->all;
    /* a gap exerts no force, and is infinite if a contact is not active in a step */
    at->rounding[c] += cosine * (link->k * (link->ends + (link->rigid ? 0.0 : link->gap)) + (link->rigid || link->law > LATIN_LAW_TANGENT ? link->tension : 0.0));
    for (PetscInt d = 0; d < dim; d++) at->translation[3 * d + c] += link->k * cosine * PetscAbsReal(link->moves[d]);
    at->tangent[c] += link->certain * cosine * PetscAbsReal(link->moves[3]);
    if (link->rigid) at->rigid[c] += PetscRealPart(a[LATIN_AT_FREE][dim * vertex + c]) * out * link->bears;
    along -= out * r;
    push += PetscSqr(r);
  }
  push = PetscSqrtReal(push);
  at->tension += link->tension;
  at->bearing += link->rigid ? 0.0 : link->tension;
  at->gaps += link->k * (link->ends + (link->rigid && structure->ground ? 0.0 : link->gap)) + link->tension;
  LatinNodalAlong(structure, link, &motion, at);
  if (push > 0.0) at->resistance += LatinResistance(latin, link, along / push, push);
}

/* Adds a link to those of its ends that are vertices first to last - 1, and to the sums over links if its first end is one of them. a: local vectors */
static void LatinNodalAddLink(LatinNodalBalance *balance, PetscInt l, PetscScalar *const a[], PetscReal target, PetscInt first, PetscInt last, LatinNode vertex[])
{
  const PetscInt *to = balance->latin->sub.structure->ends + 2 * l;
  LatinNodalLink  link;

  LatinNodalGetLink(balance->latin, l, a, target, &link);
  if (to[0] >= first && to[0] < last) LatinNodalSum(balance, &link);
  for (PetscInt i = 0; i < 2; i++)
    if (to[i] >= first && to[i] < last) LatinNodalAddEnd(balance->latin, &link, i, a, &vertex[to[i] - first]);
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
