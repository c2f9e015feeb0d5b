#include "latinimpl.h"

/*
   What rigid laws ask of a structure. Their stiffness k is no property of theirs but the ascent direction l of the local
   stage, a search parameter that decides how fast the iteration converges and not to what. Their tension is no function
   of the displacements: the structure keeps those of the last solve.
*/

#define LATIN_RIGID_SMALL 1e-3 /* displacements beside the spacing of the nodes, where no gap tells */
#define LATIN_RIGID_RUBS  0.1  /* grains with friction slip by more than their gaps */

/* The parts of a contact with friction follow each other, on one rank, with the same end nodes */
PetscErrorCode LatinLinksCheckContacts_Private(LatinLinks links, const PetscInt law[])
{
  const PetscInt dim = links->dim, n = links->links_local;
  PetscInt       bad = -1;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < n && bad < 0;) {
    const PetscInt parts = law[l] == LATIN_LAW_FRICTION ? dim : 1;

    if (law[l] == LATIN_LAW_TANGENT || l + parts > n) bad = l;
    for (PetscInt c = 1; c < parts && bad < 0; c++)
      if (law[l + c] != LATIN_LAW_TANGENT || links->nodes[2 * (l + c)] != links->nodes[2 * l] || links->nodes[2 * (l + c) + 1] != links->nodes[2 * l + 1]) bad = l;
    l += parts;
  }
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_ARG_WRONG,
             "Link %" PetscInt_FMT " is not part of a whole contact with friction: in %" PetscInt_FMT "D that is a link of law friction followed by %" PetscInt_FMT " of law tangent, with the same two nodes in the same order, all on one rank",
             links->links_start + bad, dim, dim - 1);
  PetscFunctionReturn(0);
}

/* The frame of a contact with friction must be orthonormal, and its coefficient known */
static PetscErrorCode LatinLinksCheckFrames_Private(LatinLinks links)
{
  const PetscInt dim  = links->dim;
  MPI_Comm       comm = PetscObjectComm((PetscObject)links);
  PetscInt       skew = -1, without = -1;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++) {
    if (links->law[l] != LATIN_LAW_FRICTION) continue;
    if (without < 0 && !links->friction) without = l;
    for (PetscInt b = 0; b < dim; b++)
      for (PetscInt c = 0; c < b; c++) {
        PetscReal dot = 0.0;

        for (PetscInt i = 0; i < dim; i++) dot += links->direction[dim * (l + b) + i] * links->direction[dim * (l + c) + i];
        if (skew < 0 && PetscAbsReal(dot) > PETSC_SQRT_MACHINE_EPSILON) skew = l;
      }
  }
  LatinAgree(comm, skew >= 0, PETSC_ERR_ARG_WRONG, "The directions of the contact with friction that starts at link %" PetscInt_FMT " are not at right angles: give the normal and the tangential ones with LatinLinksSetDirections()",
             links->links_start + skew);
  LatinAgree(comm, without >= 0, PETSC_ERR_ORDER, "Link %" PetscInt_FMT " has friction but no coefficient: call LatinLinksSetFriction() before LatinLinksSetUp()", links->links_start + without);
  PetscFunctionReturn(0);
}

/* One number for all elastic links, for rigid ones that have no elastic neighbour; without any, the mean load of a loaded node over the mean gap. Collective */
static PetscErrorCode LatinLinksScale_Private(LatinLinks links, PetscReal *scale)
{
  const PetscInt dim    = links->dim;
  PetscReal      sum[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, box[6], size = 0.0;

  PetscFunctionBegin;
  for (PetscInt l = 0; l < links->links_local; l++) {
    if (links->tuned[l]) {
      if (links->law[l] == LATIN_LAW_TANGENT) continue; /* its normal part has the gap */
      sum[2] += PetscAbsReal(links->prestrain[l]);
      sum[3] += 1.0;
    } else {
      sum[0] += links->stiffness[l];
      sum[1] += 1.0;
    }
  }
  for (PetscInt c = 0; c < 6; c++) box[c] = PETSC_MIN_REAL;
  for (PetscInt i = 0; i < dim * links->nodes_local; i++) {
    box[i % dim]     = PetscMax(box[i % dim], links->x[i]);
    box[3 + i % dim] = PetscMax(box[3 + i % dim], -links->x[i]);
    sum[4] += links->fixed[i] ? 0.0 : PetscAbsReal(links->force[i]);
    sum[5] += links->fixed[i] || links->force[i] == 0.0 ? 0.0 : 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 6, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)links)));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, box, 6, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)links)));
  for (PetscInt c = 0; c < dim; c++) size = PetscMax(size, box[c] + box[3 + c]);
  /* without any elastic link and without gaps, tensions do not depend on l: so that displacements are small beside the spacing of the nodes */
  if (!(sum[2] > 0.0)) {
    sum[2] = LATIN_RIGID_SMALL * size / PetscPowReal((PetscReal)links->nodes_global, 1.0 / dim);
    sum[3] = 1.0;
  }
  *scale = sum[1] > 0.0 ? sum[0] / sum[1] : sum[2] > 0.0 && sum[4] > 0.0 ? sum[4] / sum[5] / (sum[2] / sum[3]) : 1.0;
  if (links->rubs && !(sum[1] > 0.0)) *scale *= LATIN_RIGID_RUBS;
  PetscFunctionReturn(0);
}

/* The springs to the ground of the vertices here, 0 for a vertex that is held */
static PetscErrorCode LatinLinksVertexGround_Private(LatinLinks links, PetscReal ground[])
{
  Vec                local;
  const PetscScalar *g;

  PetscFunctionBegin;
  PetscCall(DMGetLocalVector(links->dm, &local));
  PetscCall(VecZeroEntries(local));
  PetscCall(DMGlobalToLocalBegin(links->dm, links->ground, INSERT_VALUES, local));
  PetscCall(DMGlobalToLocalEnd(links->dm, links->ground, INSERT_VALUES, local));
  PetscCall(VecGetArrayRead(local, &g));
  for (PetscInt i = 0; i < links->dim * links->vertices; i++) ground[i / links->dim] = PetscMax(ground[i / links->dim], g[i]);
  PetscCall(VecRestoreArrayRead(local, &g));
  PetscCall(DMRestoreLocalVector(links->dm, &local));
  PetscFunctionReturn(0);
}

/*
   Search parameters where the caller gave none: the mean stiffness of the elastic links at the two nodes, and in a time
   step what the masses of the two nodes oppose to a change of their distance. Rounded to a power of two, so that equal
   subdomains have equal ones to the bit, on any number of ranks. Collective on links
*/
PetscErrorCode LatinLinksTune_Private(LatinLinks links)
{
  PetscReal scale = 0.0, *node, *vertex, *ground;

  PetscFunctionBegin;
  links->tuning = 1.0;
  PetscCall(LatinLinksScale_Private(links, &scale));
  PetscCall(PetscCalloc1(links->vertices, &ground));
  if (links->ground) PetscCall(LatinLinksVertexGround_Private(links, ground));
  PetscCall(PetscCalloc2(2 * links->nodes_local, &node, 2 * links->vertices, &vertex));
  for (PetscInt i = 0; i < 2 * links->links_local; i++) {
    if (links->tuned[i / 2]) continue;
    vertex[2 * links->ends[i]] += links->stiffness[i / 2];
    vertex[2 * links->ends[i] + 1] += 1.0;
  }
  PetscCall(LatinSFReduce_Private(links->vertex_sf, 2, MPIU_REAL, vertex, node, MPI_SUM));
  PetscCall(LatinSFBcast_Private(links->vertex_sf, 2, MPIU_REAL, node, vertex));
  for (PetscInt l = 0; l < links->links_local; l++) {
    const PetscReal *a = vertex + 2 * links->ends[2 * l], *b = vertex + 2 * links->ends[2 * l + 1];
    const PetscReal  ga = ground[links->ends[2 * l]], gb = ground[links->ends[2 * l + 1]];
    const PetscReal  inertia = ga > 0.0 && gb > 0.0 ? ga * gb / (ga + gb) : ga + gb, elastic = a[1] + b[1] > 0.0 ? (a[0] + b[0]) / (a[1] + b[1]) : 0.0;

    if (links->tuned[l]) links->stiffness[l] = inertia + elastic > 0.0 ? PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(inertia + elastic))) : scale;
    /* one search parameter for all parts of a contact */
    if (links->law[l] == LATIN_LAW_TANGENT) links->stiffness[l] = links->stiffness[l - 1];
  }
  PetscCall(PetscFree(ground));
  PetscCall(PetscFree2(node, vertex));
  PetscFunctionReturn(0);
}

/* After the laws, and again when they change. Collective on links */
PetscErrorCode LatinLinksSetUpRigid_Private(LatinLinks links)
{
  const PetscInt n = links->links_local;

  PetscFunctionBegin;
  PetscCall(PetscFree(links->multiplier));
  PetscCall(PetscFree(links->tuned));
  if (links->rubs) PetscCall(LatinLinksCheckFrames_Private(links));
  if (links->rigid_law < 0) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(n, &links->multiplier));
  PetscCall(PetscMalloc1(n, &links->tuned));
  for (PetscInt l = 0; l < n; l++) links->tuned[l] = (PetscBool)(LatinLaws[links->law[l]].rigid && !(links->stiffness[l] > 0.0));
  PetscCall(LatinLinksTune_Private(links));
  PetscFunctionReturn(0);
}

/* Ends in an error where somebody wants a stiffness, or tensions of displacements, and there is a rigid law */
PetscErrorCode LatinLinksCheckRigid_Private(LatinLinks links, const char what[])
{
  PetscFunctionBegin;
  PetscCheck(links->rigid_law < 0, PetscObjectComm((PetscObject)links), PETSC_ERR_SUP, "%s needs laws with a stiffness, and the structure has links of the rigid law %s, which has none: solve it by -snes_type latin, or take %s", what,
             LatinLaws[links->rigid_law].name, LatinLaws[links->rigid_law].cure);
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetDirections - Gives links a direction other than from their first to their second node.

  Collective on links; before `LatinLinksSetUp()`

  Input Parameters:
+ links     - the structure
- direction - [links_local][dim] of any length; zero leaves the direction to the coordinates of the nodes

  Level: intermediate

  Notes:
  The elongation of a link is the displacement of its second node along its direction, less that of the first one. For
  contacts of nodes at the same place, the tangential parts of contacts, and the transverse stiffness of taut cables.

.seealso: `LatinLinksCreate()`, `LatinLinksSetFriction()`
@*/
PetscErrorCode LatinLinksSetDirections(LatinLinks links, const PetscReal direction[])
{
  const PetscInt dim = links->dim;
  PetscInt       bad = -1;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  LatinAgree(PetscObjectComm((PetscObject)links), links->set_up, PETSC_ERR_ORDER, "Directions must be given before LatinLinksSetUp()");
  for (PetscInt i = 0; i < dim * links->links_local && bad < 0; i++)
    if (PetscIsInfOrNanReal(direction[i])) bad = i / dim;
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_FP, "Link %" PetscInt_FMT " has a direction that is not finite", links->links_start + bad);
  for (PetscInt l = 0; l < links->links_local; l++) (void)LatinUnitVector(dim, direction + dim * l, links->direction + dim * l);
  PetscCall(PetscObjectStateIncrease((PetscObject)links));
  PetscFunctionReturn(0);
}

/*@C
  LatinLinksSetFriction - Gives the contacts of this rank their coefficients of friction.

  Collective on links; before `LatinLinksSetUp()`

  Input Parameters:
+ links       - the structure
- coefficient - [links_local] mu, read at links of law friction only

  Level: intermediate

.seealso: `LatinLinksSetLaws()`, `LatinLinksSetDirections()`
@*/
PetscErrorCode LatinLinksSetFriction(LatinLinks links, const PetscReal coefficient[])
{
  PetscInt bad = -1;

  PetscFunctionBegin;
  PetscValidHeaderSpecific(links, LATIN_LINKS_CLASSID, 1);
  LatinAgree(PetscObjectComm((PetscObject)links), links->set_up, PETSC_ERR_ORDER, "Coefficients of friction must be given before LatinLinksSetUp()");
  for (PetscInt l = 0; l < links->links_local && bad < 0; l++)
    if (!(coefficient[l] >= 0.0) || PetscIsInfOrNanReal(coefficient[l])) bad = l;
  LatinAgree(PetscObjectComm((PetscObject)links), bad >= 0, PETSC_ERR_ARG_OUTOFRANGE, "Link %" PetscInt_FMT " has the coefficient of friction %g; it is a finite number, zero or more", links->links_start + bad, (double)coefficient[bad]);
  if (!links->friction) PetscCall(PetscMalloc1(links->links_local, &links->friction));
  PetscCall(PetscArraycpy(links->friction, coefficient, links->links_local));
  PetscCall(PetscObjectStateIncrease((PetscObject)links));
  PetscFunctionReturn(0);
}
