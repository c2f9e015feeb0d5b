#include "sneslatinimpl.h"

/*
   What the laws ask of displacements that seem to have converged. Iterates that rest beside the displacements tell little
   where a state creeps: that of a node whose load is small beside the search directions of its slack links, which moves to
   its support by next to nothing a stage; and that of rigid links, whose tensions may be so large that the gaps which they
   close are lost in the rounding of tau + l e, or grow for ever since no displacement closes all of them. So

   - the end nodes of a rigid link that bears are apart by its gap, and those of any other one not further than allowed: by
     what they miss it the displacements are wrong, by 1 / sqrt(2) of it at least in the l2 norm;
   - a node where as much force is missing as there is has nothing that holds it. It moves along the missing force until a
     link resists, and is as wrong as that is far.
*/

#define LATIN_HELD_UNHELD 0.5  /* of the forces at a node: a larger unbalance, and nothing holds it */
#define LATIN_HELD_NOISE  64.0 /* times the machine's, of the forces that meet at a node */
#define LATIN_HELD_GAP    4.0  /* times the machine's, of the displacements and the gap of a link */
#define LATIN_HELD_NONE   1e3  /* times the machine's, of tau / l: displacements of links without gaps that are none */
#define LATIN_HELD_POINT  64.0 /* times the machine's, of the size: so is what coordinates do not tell */
#define LATIN_HELD_STAGES 100  /* of the damped iteration, after which tensions that grow without end show it */
#define LATIN_HELD_FAR    10.0 /* times the displacements: so far no displacement meets links that are jammed */

/* By how much a rigid link misses its gap */
static PetscReal LatinHeldMissed(LatinLinks links, PetscInt l, PetscReal x, PetscReal moved)
{
  const PetscReal tension = links->multiplier[l], noise = LATIN_HELD_GAP * PETSC_MACHINE_EPSILON * (PetscAbsReal(links->prestrain[l]) + moved);
  PetscReal       missed = 0.0;

  if (links->law[l] == LATIN_LAW_TANGENT) {
    PetscInt  normal = l;
    PetscReal size   = 0.0;

    while (links->law[normal] == LATIN_LAW_TANGENT) normal--;
    for (PetscInt c = normal + 1; c < normal + links->dim; c++) size += PetscSqr(links->multiplier[c]);
    if (PetscSqrtReal(size) < -0.999 * links->friction[normal] * links->multiplier[normal]) missed = PetscAbsReal(x); /* it sticks */
  } else if (tension != 0.0) missed = PetscAbsReal(x);
  else missed = PetscMax(0.0, links->law[l] == LATIN_LAW_INEXTENSIBLE ? x : -x);
  return PetscMax(0.0, missed - noise);
}

/* What a link opposes to a motion of one of its ends along which its strain x changes at this rate, a force each: 1 / way of the motion that the force `push` makes */
static PetscReal LatinHeldResists(LatinLinks links, PetscInt l, PetscReal x, PetscReal rate, PetscReal push)
{
  const PetscInt  law = links->law[l];
  const PetscReal k   = links->stiffness[l];
  PetscReal       closing;

  if (law == LATIN_LAW_TANGENT) return links->multiplier[l] != 0.0 ? k * rate * rate / push : 0.0;
  if (law > LATIN_LAW_TANGENT) return LatinLinksTangent(links, l, x) * rate * rate / push;
  if (law == LATIN_LAW_BAR) return k * rate * rate / push;
  if (law == LATIN_LAW_STRUT || law == LATIN_LAW_CONTACT || law == LATIN_LAW_FRICTION) {
    x    = -x;
    rate = -rate;
  }
  closing = PetscMax(0.0, rate);
  return x < 0.0 ? closing / -x : k * closing * closing / push;
}

/* The forces at the vertices here, what rounding leaves of them, and what holds them against the unbalance r */
static void LatinHeldVertices(LatinLinks links, const PetscScalar a[], const PetscScalar r[], PetscReal vertex[])
{
  const PetscInt dim = links->dim;

  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal *n = links->direction + dim * l, k = links->stiffness[l];
    const PetscReal  x = LatinLinksElongation(links, l, a) + links->prestrain[l], tension = PetscAbsReal(LatinLinksTension(links, l, x));
    PetscReal        most = PetscAbsReal(links->prestrain[l]);

    for (PetscInt end = 0; end < 2; end++)
      for (PetscInt c = 0; c < dim; c++) most += PetscAbsReal(n[c] * PetscRealPart(a[dim * links->ends[2 * l + end] + c]));
    for (PetscInt end = 0; end < 2; end++) {
      const PetscScalar *f   = r + dim * links->ends[2 * l + end];
      PetscReal         *sum = vertex + 3 * links->ends[2 * l + end], along = 0.0, push = 0.0;

      for (PetscInt c = 0; c < dim; c++) {
        along -= (end ? n[c] : -n[c]) * PetscRealPart(f[c]);
        push += PetscSqr(PetscRealPart(f[c]));
      }
      push = PetscSqrtReal(push);
      sum[0] += tension;
      sum[1] += k * most + tension;
      if (push > 0.0) sum[2] += LatinHeldResists(links, l, x, along / push, push);
    }
  }
}

/* Nodes that nothing holds: how far they have to go, and which they are; a node that no link would stop has no end. Collective on links */
static PetscErrorCode LatinHeldNodes_Private(LatinLinks links, Vec u, Vec r, LatinHeld *held)
{
  const PetscInt dim  = links->dim;
  PetscReal      way2 = 0.0, *vertex, *node, *push, *most;
  PetscInt       mine[LATIN_LOOSE], count[3] = {0, 0, 0}; /* unheld nodes, those without end, and those of which rounding hides it */
  Vec            local[3];
  PetscScalar   *a[3];

  PetscFunctionBegin;
  PetscCall(PetscCalloc4(3 * links->vertices, &vertex, 3 * links->nodes_local, &node, 2 * links->vertices, &push, 2 * links->nodes_local, &most));
  for (PetscInt i = 0; i < 3; i++) {
    PetscCall(DMGetLocalVector(links->dm, &local[i]));
    PetscCall(VecZeroEntries(local[i]));
  }
  PetscCall(LatinLinksGetLocal_Private(links, u, local[0]));
  PetscCall(DMGlobalToLocalBegin(links->dm, r, INSERT_VALUES, local[1]));
  PetscCall(DMGlobalToLocalEnd(links->dm, r, INSERT_VALUES, local[1]));
  if (links->ground) {
    PetscCall(DMGlobalToLocalBegin(links->dm, links->ground, INSERT_VALUES, local[2]));
    PetscCall(DMGlobalToLocalEnd(links->dm, links->ground, INSERT_VALUES, local[2]));
  }
  for (PetscInt i = 0; i < 3; i++) PetscCall(VecGetArray(local[i], &a[i]));
  LatinHeldVertices(links, a[0], a[1], vertex);
  for (PetscInt v = 0; v < links->vertices; v++) {
    for (PetscInt c = 0; c < dim; c++) {
      push[2 * v] += PetscSqr(PetscRealPart(a[1][dim * v + c]));
      push[2 * v + 1] = PetscMax(push[2 * v + 1], PetscRealPart(a[2][dim * v + c]));
    }
    push[2 * v] = PetscSqrtReal(push[2 * v]);
  }
  for (PetscInt i = 0; i < 3; i++) {
    PetscCall(VecRestoreArray(local[i], &a[i]));
    PetscCall(DMRestoreLocalVector(links->dm, &local[i]));
  }
  PetscCall(LatinSFReduce_Private(links->vertex_sf, 3, MPIU_REAL, vertex, node, MPI_SUM));
  PetscCall(LatinSFReduce_Private(links->vertex_sf, 2, MPIU_REAL, push, most, MPI_MAX));
  for (PetscInt i = 0; i < links->nodes_local; i++) {
    PetscReal load = 0.0;

    for (PetscInt c = 0; c < dim; c++) load += links->fixed[dim * i + c] ? 0.0 : PetscSqr(links->force[dim * i + c]);
    if (most[2 * i + 1] > 0.0 || most[2 * i] <= LATIN_HELD_UNHELD * (node[3 * i] + PetscSqrtReal(load))) continue;
    if (most[2 * i] <= LATIN_HELD_NOISE * PETSC_MACHINE_EPSILON * node[3 * i + 1]) {
      if (!(load > 0.0)) continue;
      count[2]++;
    }
    if (count[0] < LATIN_LOOSE) mine[count[0]] = links->nodes_start + i;
    count[0]++;
    if (node[3 * i + 2] > 0.0) way2 += PetscSqr(1.0 / node[3 * i + 2]);
    else count[1]++;
  }
  PetscCall(PetscFree4(vertex, node, push, most));
  for (PetscInt i = count[0]; i < LATIN_LOOSE; i++) mine[i] = PETSC_MAX_INT;
  PetscCall(LatinListFirst_Private(PetscObjectComm((PetscObject)links), LATIN_LOOSE, mine, held->node));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, count, 3, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)links)));
  PetscCall(MPIU_Allreduce(&way2, &held->way, 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  held->nodes  = count[0];
  held->hidden = count[2];
  held->way    = count[1] ? INFINITY : PetscSqrtReal(held->way);
  PetscFunctionReturn(0);
}

/* The greatest distance by which a rigid link misses its gap; 0 where nothing moves but by rounding. Collective on links */
static PetscErrorCode LatinHeldGaps_Private(LatinLinks links, Vec u, LatinHeld *held)
{
  const PetscInt     dim    = links->dim;
  PetscReal          sum[2] = {0.0, 0.0}, most[2] = {0.0, 0.0}, size, moved[2]; /* squares of tau / l, and of the gaps of links that bear, or should; what is missed, what is prescribed */
  PetscBool          moves, gaps;
  Vec                local;
  const PetscScalar *a;

  PetscFunctionBegin;
  held->missed = 0.0;
  if (links->rigid_law < 0) PetscFunctionReturn(0);
  PetscCall(DMGetLocalVector(links->dm, &local));
  PetscCall(LatinLinksGetLocal_Private(links, u, local));
  PetscCall(VecGetArrayRead(local, &a));
  for (PetscInt l = 0; l < links->links_local; l++) {
    PetscReal ends = 0.0, missed;

    if (!LatinLaws[links->law[l]].rigid) continue;
    for (PetscInt end = 0; end < 2; end++)
      for (PetscInt c = 0; c < dim; c++) ends += PetscAbsReal(links->direction[dim * l + c] * PetscRealPart(a[dim * links->ends[2 * l + end] + c]));
    missed  = LatinHeldMissed(links, l, LatinLinksElongation(links, l, a) + links->prestrain[l], ends);
    most[0] = PetscMax(most[0], missed);
    if (links->multiplier[l] == 0.0 && missed == 0.0) continue;
    sum[0] += PetscSqr(links->multiplier[l] / links->stiffness[l]);
    sum[1] += PetscSqr(links->prestrain[l]);
  }
  PetscCall(VecRestoreArrayRead(local, &a));
  PetscCall(DMRestoreLocalVector(links->dm, &local));
  for (PetscInt i = 0; i < dim * links->nodes_local; i++)
    if (links->fixed[i]) most[1] = PetscMax(most[1], PetscAbsReal(links->prescribed[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, most, 2, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)links)));
  PetscCall(VecNorm(u, NORM_2, &moved[0]));
  PetscCall(VecNorm(u, NORM_INFINITY, &moved[1]));
  PetscCall(LatinLinksSize_Private(links, &size));
  size *= PETSC_MACHINE_EPSILON;
  moves        = (PetscBool)(moved[0] > LATIN_HELD_NONE * PETSC_MACHINE_EPSILON * PetscSqrtReal(sum[0]) && moved[1] > LATIN_HELD_POINT * size);
  gaps         = (PetscBool)(PetscSqrtReal(sum[1]) > LATIN_HELD_GAP * size || most[1] > LATIN_HELD_GAP * size);
  held->missed = moves || gaps ? most[0] : 0.0;
  PetscFunctionReturn(0);
}

/* What is wrong at least with the displacements u, of unbalance r, as a length. Collective on links */
PetscErrorCode LatinHeld_Private(LatinLinks links, Vec u, Vec r, LatinHeld *held)
{
  PetscFunctionBegin;
  PetscCall(LatinHeldNodes_Private(links, u, r, held));
  PetscCall(LatinHeldGaps_Private(links, u, held));
  PetscFunctionReturn(0);
}

/*
   Rigid links that no displacement meets together. Their tensions grow for ever, by the same self-stress dtau from one stage
   of the damped iteration to the next: B^t dtau = 0, while dtau . x = dtau . (e0 + B u) is not positive for any admissible
   strains x [J. Farkas]. Where dtau . e0 is, by more than B^t dtau can make up for on displacements ten times as large as u,
   there are none. `dtau` has the links of this rank. Collective on links
*/
static PetscErrorCode LatinHeldFarkas_Private(LatinLinks links, Vec u, const PetscReal dtau[], LatinHeld *held)
{
  PetscReal          sum[2] = {0.0, 0.0}, most = 0.0, moved, left; /* the work on gaps and prescribed displacements, and of each by itself */
  PetscInt           mine[LATIN_LOOSE], count  = 0;
  Vec                given, local, forces;
  const PetscScalar *a;
  PetscScalar       *f;

  PetscFunctionBegin;
  PetscCall(DMGetGlobalVector(links->dm, &forces));
  PetscCall(DMGetLocalVector(links->dm, &given));
  PetscCall(DMGetLocalVector(links->dm, &local));
  PetscCall(VecZeroEntries(forces));
  PetscCall(LatinLinksGetLocal_Private(links, forces, given)); /* what is prescribed, and nothing else */
  PetscCall(VecZeroEntries(local));
  PetscCall(VecGetArrayRead(given, &a));
  PetscCall(VecGetArray(local, &f));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal work = dtau[l] * (LatinLinksElongation(links, l, a) + links->prestrain[l]);

    sum[0] += work;
    sum[1] += PetscAbsReal(work);
    most = PetscMax(most, PetscAbsReal(dtau[l]));
    LatinLinksAddForce(links, l, dtau[l], f);
  }
  PetscCall(VecRestoreArray(local, &f));
  PetscCall(VecRestoreArrayRead(given, &a));
  PetscCall(DMLocalToGlobalBegin(links->dm, local, ADD_VALUES, forces));
  PetscCall(DMLocalToGlobalEnd(links->dm, local, ADD_VALUES, forces));
  PetscCall(VecNorm(forces, NORM_2, &left));
  PetscCall(VecNorm(u, NORM_2, &moved));
  PetscCall(DMRestoreLocalVector(links->dm, &local));
  PetscCall(DMRestoreLocalVector(links->dm, &given));
  PetscCall(DMRestoreGlobalVector(links->dm, &forces));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)links)));
  held->links = 0;
  if (!(sum[0] > LATIN_HELD_FAR * left * moved + PETSC_SQRT_MACHINE_EPSILON * sum[1])) PetscFunctionReturn(0);
  for (PetscInt l = 0; l < links->links_local; l++) {
    if (PetscAbsReal(dtau[l]) < LATIN_HELD_UNHELD * most) continue;
    if (count < LATIN_LOOSE) mine[count] = links->links_start + l;
    count++;
  }
  for (PetscInt i = count; i < LATIN_LOOSE; i++) mine[i] = PETSC_MAX_INT;
  PetscCall(LatinListFirst_Private(PetscObjectComm((PetscObject)links), LATIN_LOOSE, mine, held->link));
  PetscCall(MPIU_Allreduce(&count, &held->links, 1, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)links)));
  PetscFunctionReturn(0);
}

/* Damped stages from the start tell whether rigid links are jammed; z and work are of the length of a state. Displacements in the subdomains are lost, tensions of links stay. Collective on latin */
PetscErrorCode LatinHeldJammed_Private(Latin latin, Vec z, Vec work, LatinHeld *held)
{
  LatinLinks     links        = latin->links;
  const PetscInt applications = latin->applications;
  PetscReal     *before, *dtau;
  Vec            u;

  PetscFunctionBegin;
  held->links = 0;
  if (links->rigid_law < 0 || links->rubs || links->ground) PetscFunctionReturn(0); /* rigid links of a time step have no gaps, or do not bear */
  PetscCall(PetscMalloc2(links->links_local, &before, links->links_local, &dtau));
  PetscCall(PetscArraycpy(before, links->multiplier, links->links_local));
  PetscCall(LatinInitialState_Private(latin, z));
  for (PetscInt k = 0; k < LATIN_HELD_STAGES && !latin->failed; k++) {
    if (k == LATIN_HELD_STAGES - 1) {
      PetscCall(LatinSubstructureReturn_Private(latin));
      PetscCall(PetscArraycpy(dtau, links->multiplier, links->links_local));
    }
    PetscCall(LatinApply_Private(latin, z, work));
    PetscCall(VecAXPBY(z, 0.5, 0.5, work)); /* damped, or tensions would only swing */
  }
  PetscCall(DMGetGlobalVector(links->dm, &u));
  PetscCall(LatinAverage_Private(latin, u));
  PetscCall(LatinSubstructureReturn_Private(latin));
  for (PetscInt l = 0; l < links->links_local; l++) dtau[l] = LatinLaws[links->law[l]].rigid ? links->multiplier[l] - dtau[l] : 0.0;
  if (!latin->failed) PetscCall(LatinHeldFarkas_Private(links, u, dtau, held));
  PetscCall(DMRestoreGlobalVector(links->dm, &u));
  PetscCall(PetscArraycpy(links->multiplier, before, links->links_local));
  PetscCall(PetscFree2(before, dtau));
  latin->applications = applications;
  PetscFunctionReturn(0);
}
