#include "structure/structureimpl.h"

/*
   Rigid laws: search parameters and checks. The k of a rigid link is no stiffness but the ascent direction l of the local stage, a search parameter,
   which affects speed, not the result. The structure stores the value of the caller, 0: automatic. Automatic values, computed here, are also the scale
   of forces and of penalties, whatever the caller sets. Tensions of rigid links are no function of the displacements: the solver stores them.
*/

#define LATIN_RIGID_SMALL 1e-3 /* assumed mean gap, relative to the spacing of the nodes, if all gaps are zero: iterations do not depend on it */
#define LATIN_HELD_NOISE  8.0  /* times eps and the sum of prescribed displacements and gap: rounding of an elongation */
#define LATIN_RIGID_RUBS  0.1  /* factor on the search parameter of grains with friction, which slip by more than their gaps */

/* Checks contacts with friction: consecutive parts, on one rank, with the same end nodes, orthogonal directions, a coefficient. Collective on structure */
PetscErrorCode LatinStructureCheckContacts_Private(LatinStructure structure)
{
  const PetscInt   dim = structure->dim, n = structure->links_local, *law = structure->law;
  const PetscReal *direction = structure->direction;
  MPI_Comm         comm      = PetscObjectComm((PetscObject)structure);
  PetscInt         bad = -1, skew = -1, without = -1;

  PetscFunctionBegin;
  if (!structure->has_friction) PetscFunctionReturn(0);
  for (PetscInt l = 0, parts; l < n && bad < 0; l += parts) {
    parts = law[l] == LATIN_LAW_FRICTION ? dim : 1;
    if (law[l] == LATIN_LAW_TANGENT || l + parts > n) bad = l;
    if (law[l] == LATIN_LAW_FRICTION && without < 0 && !structure->friction) without = l;
    for (PetscInt b = l + 1; b < l + parts && bad < 0; b++) {
      if (law[b] != LATIN_LAW_TANGENT || structure->nodes[2 * b] != structure->nodes[2 * l] || structure->nodes[2 * b + 1] != structure->nodes[2 * l + 1]) bad = l;
      for (PetscInt c = l; c < b; c++) {
        PetscReal dot = 0.0;

        for (PetscInt i = 0; i < dim; i++) dot += direction[dim * b + i] * direction[dim * c + i];
        if (skew < 0 && PetscAbsReal(dot) > PETSC_SQRT_MACHINE_EPSILON) skew = l;
      }
    }
  }
  LatinAgree(comm, bad >= 0, PETSC_ERR_ARG_WRONG,
             "Link %" PetscInt_FMT " is not part of a complete contact with friction: in %" PetscInt_FMT "D that is a link of law friction followed by %" PetscInt_FMT " of law tangent, with the same two nodes in the same order, all on one rank",
             structure->links_start + bad, dim, dim - 1);
  LatinAgree(comm, skew >= 0, PETSC_ERR_ARG_WRONG,
             "The directions of the contact with friction that starts at link %" PetscInt_FMT " are not orthogonal: set the normal and the tangential ones with LatinStructureSetDirections() (in Python, latinpc.Structure(..., direction=...))",
             structure->links_start + skew);
  LatinAgree(comm, without >= 0, PETSC_ERR_ORDER, "Link %" PetscInt_FMT " has friction but no coefficient: call LatinStructureSetFriction() before LatinStructureSetUp() (in Python, latinpc.Structure(..., friction=...))",
             structure->links_start + without);
  PetscFunctionReturn(0);
}

/* Sums over all ranks, for the search parameter of rigid links */
typedef struct {
  PetscReal stiffness, elastic; /* sum of the stiffnesses of elastic links; their number */
  PetscReal gap, rigid;         /* sum of the absolute gaps of rigid links; their number */
  PetscReal load, loaded;       /* sum of the absolute loads of free components; number of loaded ones */
} LatinRigidSums;

/* Computes these sums. Collective on structure */
static PetscErrorCode LatinRigidSum_Private(LatinStructure structure, LatinRigidSums *sum)
{
  PetscFunctionBegin;
  PetscCall(PetscMemzero(sum, sizeof(*sum)));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    if (structure->law[l] == LATIN_LAW_TANGENT) continue; /* its normal part has the gap */
    if (LatinLaws[structure->law[l]].rigid) {
      sum->gap += PetscAbsReal(structure->e0[l]);
      sum->rigid += 1.0;
    } else {
      sum->stiffness += structure->stiffness[l];
      sum->elastic += 1.0;
    }
  }
  for (PetscInt i = 0; i < structure->dim * structure->nodes_local; i++) {
    if (structure->fixed[i] || structure->force[i] == 0.0) continue;
    sum->load += PetscAbsReal(structure->force[i]);
    sum->loaded += 1.0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, sizeof(*sum) / sizeof(PetscReal), MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)structure)));
  PetscFunctionReturn(0);
}

/*
   Computes the search parameter of rigid links that have neither elastic neighbours nor masses: the mean stiffness of elastic links; without these, the
   mean of the present loads (absolute values of free components that are loaded) over the mean gap. Of a time step, that of its base. Collective on step
*/
PetscErrorCode LatinStructureRigidScale_Private(LatinStructure step, PetscReal *scale)
{
  const LatinStructure structure = step->base ? step->base : step;
  const PetscInt       dim       = structure->dim;
  PetscReal            low[3], high[3], size = 0.0, gap;
  LatinRigidSums       sum;

  PetscFunctionBegin;
  PetscCall(LatinRigidSum_Private(structure, &sum));
  if (sum.elastic > 0.0) {
    *scale = sum.stiffness / sum.elastic;
    PetscFunctionReturn(0);
  }
  PetscCall(DMGetBoundingBox(structure->dm, low, high));
  for (PetscInt c = 0; c < dim; c++) size = PetscMax(size, high[c] - low[c]);
  /* without gaps, tensions do not depend on the search parameter */
  gap    = sum.gap > 0.0 ? sum.gap / sum.rigid : LATIN_RIGID_SMALL * size / PetscPowReal((PetscReal)structure->nodes_global, 1.0 / dim);
  *scale = gap > 0.0 && sum.load > 0.0 ? sum.load / sum.loaded / gap : 1.0;
  if (structure->has_friction) *scale *= LATIN_RIGID_RUBS;
  PetscFunctionReturn(0);
}

/*
   Computes k, [links_local]: stiffnesses; of rigid links automatic search parameters. These are the mean stiffness of the elastic links at the two
   nodes, plus in a time step the inertia M / h^2 of the two nodes against a change of their distance, rounded to powers of two: equal subdomains have
   bitwise equal values on any number of ranks. scale: value of rigid links that have neither; 0: LatinStructureRigidScale_Private(). Collective on structure
*/
PetscErrorCode LatinStructureStiffness_Private(LatinStructure structure, PetscReal scale, PetscReal k[])
{
  PetscReal         *node, *vertex, *ground;
  Vec                local;
  const PetscScalar *g;

  PetscFunctionBegin;
  PetscCall(PetscArraycpy(k, structure->stiffness, structure->links_local));
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  if (!(scale > 0.0)) PetscCall(LatinStructureRigidScale_Private(structure, &scale));
  PetscCall(PetscCalloc3(2 * structure->nodes_local, &node, 2 * structure->vertices, &vertex, structure->vertices, &ground));
  if (structure->ground) {
    PetscCall(LatinStructureOpen_Private(structure, NULL, structure->ground, &local, &g)); /* 0 where prescribed */
    for (PetscInt i = 0; i < structure->dim * structure->vertices; i++) ground[i / structure->dim] = PetscMax(ground[i / structure->dim], g[i]);
    PetscCall(LatinStructureClose_Private(structure, &local, &g));
  }
  for (PetscInt i = 0; i < 2 * structure->links_local; i++) {
    if (LatinLaws[structure->law[i / 2]].rigid) continue;
    vertex[2 * structure->ends[i]] += structure->stiffness[i / 2];
    vertex[2 * structure->ends[i] + 1] += 1.0;
  }
  PetscCall(LatinSFReduce_Private(structure->vertex_sf, 2, MPIU_REAL, vertex, node, MPI_SUM));
  PetscCall(LatinSFBcast_Private(structure->vertex_sf, 2, MPIU_REAL, node, vertex));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    const PetscReal *a = vertex + 2 * structure->ends[2 * l], *b = vertex + 2 * structure->ends[2 * l + 1];
    const PetscReal  ga = ground[structure->ends[2 * l]], gb = ground[structure->ends[2 * l + 1]];
    const PetscReal  inertia = ga > 0.0 && gb > 0.0 ? ga * gb / (ga + gb) : ga + gb, elastic = a[1] + b[1] > 0.0 ? (a[0] + b[0]) / (a[1] + b[1]) : 0.0;

    if (LatinLaws[structure->law[l]].rigid) k[l] = inertia + elastic > 0.0 ? PetscPowReal(2.0, PetscFloorReal(0.5 + PetscLog2Real(inertia + elastic))) : scale;
    /* all parts of a contact have that of the normal part */
    if (structure->law[l] == LATIN_LAW_TANGENT) k[l] = k[l - 1];
  }
  PetscCall(PetscFree3(node, vertex, ground));
  PetscFunctionReturn(0);
}

/*
   Checks that no link is rigid, unless springs replace rigid links: for functions that need stiffnesses, or tensions as a function of displacements.
   what: subject of the message. Collective on structure
*/
PetscErrorCode LatinStructureCheckRigid_Private(LatinStructure structure, const char what[])
{
  PetscFunctionBegin;
  PetscCheck(structure->rigid_law < 0 || structure->penalty, PetscObjectComm((PetscObject)structure), PETSC_ERR_SUP,
             "%s needs laws with a stiffness, and the structure has links of the rigid law %s, which has none: solve it by -snes_type latin, or take %s", what, LatinLaws[structure->rigid_law].name, LatinLaws[structure->rigid_law].cure);
  PetscFunctionReturn(0);
}

/* Returns the strain of link l under the vertex displacements a, of rotating links without linearisation */
static PetscReal LatinHeldStrain(LatinStructure structure, PetscInt l, const PetscScalar a[])
{
  const PetscInt   dim  = structure->dim;
  const PetscReal *r0   = structure->span + dim * l;
  PetscReal        size = 0.0, length = 0.0;

  if (!structure->span || LatinStructureKeeps(structure, l)) return LatinStructureElongation(structure, l, a) + structure->e0[l];
  for (PetscInt c = 0; c < dim; c++) {
    size += PetscSqr(r0[c] + PetscRealPart(a[dim * structure->ends[2 * l + 1] + c] - a[dim * structure->ends[2 * l] + c]));
    length += PetscSqr(r0[c]);
  }
  return PetscSqrtReal(size) - PetscSqrtReal(length) + structure->e0[l];
}

/* Whether no free displacement strains the rigid link l. free: [vertices][dim], not zero at free components. Tangential parts of contacts have no gap */
static PetscBool LatinHeldRigid(LatinStructure structure, PetscInt l, const PetscScalar free[])
{
  const PetscInt   dim = structure->dim, *to = structure->ends + 2 * l;
  const PetscReal *n       = structure->direction + dim * l;
  const PetscBool  rotates = (PetscBool)(structure->span && !LatinStructureKeeps(structure, l));

  if (!LatinLaws[structure->law[l]].rigid || structure->law[l] == LATIN_LAW_TANGENT) return PETSC_FALSE;
  for (PetscInt c = 0; c < dim; c++) {
    if (!rotates && n[c] == 0.0) continue;
    if (PetscRealPart(free[dim * to[0] + c]) != 0.0 || PetscRealPart(free[dim * to[1] + c]) != 0.0) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

/* Returns the sum of the terms of the strain of link l under the vertex displacements a, which rounding multiplies */
static PetscReal LatinHeldTerms(LatinStructure structure, PetscInt l, const PetscScalar a[])
{
  const PetscInt   dim = structure->dim, *to = structure->ends + 2 * l;
  const PetscReal *n   = structure->direction + dim * l;
  PetscReal        sum = PetscAbsReal(structure->e0[l]);

  for (PetscInt c = 0; c < dim; c++) sum += PetscAbsReal(structure->span ? 1.0 : n[c]) * (PetscAbsScalar(a[dim * to[0] + c]) + PetscAbsScalar(a[dim * to[1] + c]));
  return sum;
}

/*
   Checks, before a solve, rigid links that no free displacement strains: prescribed displacements of their ends (in a time step, increments) must be
   kinematically admissible. If not: an error; a time step, which may fail, sets *jam to such a link of this rank, -1: none. Collective on structure
*/
PetscErrorCode LatinStructureCheckHeld_Private(LatinStructure structure, PetscInt *jam)
{
  PetscInt           bad    = -1;
  PetscReal          missed = 0.0, most;
  Vec                none, u, open;
  const PetscScalar *a, *free;

  PetscFunctionBegin;
  *jam = -1;
  if (structure->rigid_law < 0) PetscFunctionReturn(0);
  PetscCall(DMGetGlobalVector(structure->dm, &none));
  PetscCall(VecZeroEntries(none));
  PetscCall(LatinStructureOpen_Private(structure, structure->vertex_prescribed, none, &u, &a));
  PetscCall(VecSet(none, 1.0));
  PetscCall(LatinStructureOpen_Private(structure, NULL, none, &open, &free));
  for (PetscInt l = 0; l < structure->links_local; l++) {
    PetscReal by;

    if (!LatinHeldRigid(structure, l, free)) continue;
    by = LatinLawSign(structure->law[l]) * LatinHeldStrain(structure, l, a);
    if (by <= missed || by <= LATIN_HELD_NOISE * PETSC_MACHINE_EPSILON * LatinHeldTerms(structure, l, a)) continue;
    missed = by;
    bad    = l;
  }
  PetscCall(LatinStructureClose_Private(structure, &open, &free));
  PetscCall(LatinStructureClose_Private(structure, &u, &a));
  PetscCall(DMRestoreGlobalVector(structure->dm, &none));
  if (structure->ground) {
    if (bad >= 0) *jam = structure->links_start + bad;
    PetscFunctionReturn(0);
  }
  PetscCall(MPIU_Allreduce(&missed, &most, 1, MPIU_REAL, MPIU_MAX, PetscObjectComm((PetscObject)structure)));
  if (missed < most) bad = -1; /* the error names the link that misses its gap by the most */
  LatinAgree(PetscObjectComm((PetscObject)structure), bad >= 0, PETSC_ERR_ARG_INCOMP,
             "Link %" PetscInt_FMT " (%s) has prescribed displacements that are not kinematically admissible: they miss its gap by %g. Change them or its initial elongation, or remove the link", structure->links_start + bad,
             LatinLaws[structure->law[PetscMax(0, bad)]].name, (double)missed);
  PetscFunctionReturn(0);
}
