/*
   Structures of links: their data, and the functions shared by their files and by the solvers. Each file calls only those before it:

     laws, userlaws; vectors; turning, turningtangent, geometric; rigidlaws; tangent, linesearch; residual, results; setup; actions; structure; timestep,
     frame, frictioncones; attach
*/
#ifndef LATINSTRUCTUREIMPL_H
#define LATINSTRUCTUREIMPL_H

#include "base/collective.h"
#include "base/compat.h"
#include "base/dense.h"
#include "base/interrupt.h"
#include "base/latinbase.h"
#include "base/rankfailure.h"
#include "structure/laws.h"
#include <petsc/private/petscimpl.h>
#include <petscdmplex.h>
#include <petscsf.h>

/* ---- structures (structure/structure.c, structure/setup.c) ---- */
/* Search directions of the parts of a frame (structure/frame.c) */
typedef enum {
  LATIN_FRAME_DRAWN,   /* for the drawn configuration */
  LATIN_FRAME_PRESENT, /* at displacements, with reduced stiffnesses of cables that may slacken or tighten */
  LATIN_FRAME_TANGENT, /* the tangent stiffness at displacements, for Newton's method */
  LATIN_FRAME_FIRM     /* the same without the negative geometric stiffness of links in compression */
} LatinFrameType;

struct _p_LatinStructure {
  PETSCHEADER(int);
  /* from dim to keeps: a time step, a frame and cones copy the members of their base */
  PetscInt dim;
  PetscInt nodes_local, nodes_global; /* numbers of the caller's nodes: of this rank, of all */
  PetscInt links_local, links_global; /* the same of links */
  PetscInt nodes_start, links_start;  /* global numbers of the first ones of this rank */
  /* the caller's nodes of this rank */
  PetscReal *x, *force;  /* [nodes_local][dim] */
  PetscBool *fixed;      /* [nodes_local][dim] */
  PetscInt  *global_dof; /* [nodes_local][dim] entries in DM global vectors, negative where prescribed */
  /* the caller's links of this rank */
  PetscInt     *nodes;                 /* [links_local][2] global node numbers */
  PetscInt     *ends;                  /* [links_local][2] vertices of the DM */
  PetscInt     *law;                   /* [links_local] LatinLawType */
  PetscReal    *stiffness;             /* [links_local] k, force/length; of rigid links the search parameter, 0: automatic */
  PetscReal    *direction;             /* [links_local][dim] unit vectors n, by default from the first to the second node: a row of B is (-n, n) */
  PetscReal    *friction;              /* [links_local] coefficients of friction, valid at normal parts of contacts; NULL: not set */
  PetscInt      rigid_law;             /* first law in the table that rigid links of any rank have; -1: no rigid links */
  PetscBool     general, has_friction; /* whether any rank has laws beyond bar, cable and compression only; contacts with friction */
  PetscBool     own_laws;              /* whether any rank has registered laws (structure/userlaws.c) */
  PetscSF       vertex_sf;             /* from the caller's nodes to the DM's vertices of this rank */
  PetscInt      vertices;              /* number of the DM's vertices on this rank */
  PetscInt      unlinked;              /* number of this rank's nodes without links: the last vertices */
  PetscInt      shared;                /* number of vertices that other ranks have as well */
  PetscInt     *shared_vertex;         /* [shared] their numbers here, ascending */
  PetscSF       shared_sf;             /* from their owners to the other ranks, by indices in this list; NULL: one rank */
  PetscInt      free_unlinked;         /* first free component, dim * node + direction, of a node without links on any rank; -1: none */
  PetscBool     set_up;
  LatinGeometry geometry; /* rotations of links (structure/turning.c) */
  PetscBool    *keeps;    /* [links_local] geometry large: whether a link has a fixed direction; else NULL */
  /* a time step has its own of the members below */
  PetscReal       *prescribed;        /* [nodes_local][dim] */
  PetscReal       *vertex_prescribed; /* [vertices][dim] */
  PetscReal       *held;              /* [nodes_local][dim] time step: prescribed displacements of its base at its start */
  PetscReal       *vertex_held;       /* [vertices][dim] */
  PetscReal       *e0;                /* [links_local] */
  PetscReal       *span;              /* [links_local][dim] vectors from first to second nodes, as drawn, of a time step at its start; NULL: linear */
  PetscBool        midpoint;          /* whether this is a time step with geometry large (structure/midpoint.h) */
  DM               dm;
  Vec              load;                             /* F at free dofs, a DM global vector */
  PetscObjectState load_state, e0_state, held_state; /* counts of changes of load, e0, prescribed; solvers compare them */
  /* dynamics (structure/timestep.c), NULL in statics */
  PetscReal       *mass;       /* [nodes_local] */
  Vec              inertia;    /* M at free dofs */
  LatinStructure   base;       /* the structure in motion, of which this is a time step */
  PetscObjectState base_state; /* state of the base at the last update */
  Vec              ground;     /* springs between the nodes and the ground, at free dofs: M / h^2 of a time step */
  PetscReal        shift;      /* 1 / h^2 */
  /* [links_local] while rigid links are springs in the method of multipliers (snes/multipliers.c), else NULL; borrowed */
  const PetscReal *penalty, *multiplier;
  /*
     Tangent of a link in Newton's method with large displacements, [links_local], borrowed; NULL: that of the displacements. Set by
     LatinStructurePrescribe()

       ahead           far from the solution: tensions ahead of the displacements (snes/largenewton.c), stiffnesses of the laws
       ahead, strain   near it: laws are linearised about these strains, also in the unbalance
       ahead, slope    interior-point method: tensions and stiffnesses of its smooth laws (snes/largeinterior.c)
       slope           other stiffnesses at the tensions of the displacements (snes/largekinks.c); LATIN_SLACK: none, and no tension
  */
  const PetscReal *ahead, *strain, *slope;
  PetscReal        hold;     /* with `ahead`, not `slope`: stiffness of slack cables, relative to the mean tension over length of taut links */
  LatinStructure   cones_of; /* cones (structure/frictioncones.c): the structure with friction; else NULL */
  /* frame (structure/frame.c); else NULL */
  LatinStructure   original;                    /* the structure whose links are split into parts */
  PetscObjectState original_state, original_e0; /* its state and e0_state at the last LatinFrameFollow_Private() */
  PetscObjectState parts_state;                 /* state of the frame at the last change of laws; later changes are of directions and stiffnesses alone */
  PetscReal       *part;                        /* [links_local][LATIN_PART] geometry large: data of the parts (structure/turning.h) */
  LatinFrameType   made;                        /* geometry large: type of the present search directions */
  PetscReal       *spring;                      /* [2][links of the original] penalties, multipliers of rigid links as springs; NULL without rigid links */
};

/* Sets tensions, strains and stiffnesses of the tangent stiffness, see the members; all NULL: those of the displacements. Not collective */
static inline void LatinStructurePrescribe(LatinStructure structure, const PetscReal ahead[], const PetscReal strain[], const PetscReal slope[])
{
  structure->ahead  = ahead;
  structure->strain = strain;
  structure->slope  = slope;
}

/* ---- one link, l: its number on this rank ---- */
/* Returns the elongation of link l under the vertex displacements a: a row of B */
static inline PetscReal LatinStructureElongation(LatinStructure structure, PetscInt l, const PetscScalar a[])
{
  const PetscInt     dim = structure->dim;
  const PetscReal   *n   = structure->direction + dim * l;
  const PetscScalar *ua = a + dim * structure->ends[2 * l], *ub = a + dim * structure->ends[2 * l + 1];
  PetscReal          e = 0.0;

  for (PetscInt c = 0; c < dim; c++) e += n[c] * (ub[c] - ua[c]);
  return e;
}

#define LATIN_TURNING_OWN 1e-8 /* least difference, in a component, of a unit vector of the user from that of the nodes; smaller ones are rounding */

/* Whether link l has a direction of its own, other than that of its nodes, which are r0 apart */
static inline PetscBool LatinStructureOwnDirection(LatinStructure structure, PetscInt l, const PetscReal r0[])
{
  PetscReal n[3] = {0.0, 0.0, 0.0}, apart = 0.0;

  (void)LatinUnitVector(structure->dim, r0, n);
  for (PetscInt c = 0; c < structure->dim; c++) apart = PetscMax(apart, PetscAbsReal(n[c] - structure->direction[structure->dim * l + c]));
  return (PetscBool)(apart > LATIN_TURNING_OWN);
}

/* Adds to f, [vertices][dim], the forces of link l under the tension t: a column of B^t */
static inline void LatinStructureAddForce(LatinStructure structure, PetscInt l, PetscReal t, PetscScalar f[])
{
  const PetscInt   dim = structure->dim;
  const PetscReal *n   = structure->direction + dim * l;
  PetscScalar     *fa = f + dim * structure->ends[2 * l], *fb = f + dim * structure->ends[2 * l + 1];

  for (PetscInt c = 0; c < dim; c++) {
    fa[c] -= t * n[c];
    fb[c] += t * n[c];
  }
}

/* Returns the tension of a rigid link as a spring: max(0, lambda + r x) for laws of traction, min(0, lambda + r x) for laws of compression */
static inline PetscReal LatinStructureSpring(const LatinStructure structure, PetscInt l, PetscReal x)
{
  return LatinUnilateralTension(LatinLawSign(structure->law[l]), 1.0, structure->multiplier[l] + structure->penalty[l] * x);
}

/* Returns the tension of a link of strain x. rigid: tensions of rigid links, from the solver; NULL: zero */
static inline PetscReal LatinStructureTension(const LatinStructure structure, const PetscReal rigid[], PetscInt l, PetscReal x)
{
  const LatinLaw *law = &LatinLaws[structure->law[l]];

  if (law->rigid) return structure->penalty ? LatinStructureSpring(structure, l, x) : rigid ? rigid[l] : 0.0;
  return law->tension(structure->stiffness[l], x, law->ctx);
}

#define LATIN_SLACK -1.0 /* in `slope`: the link bears nothing, whatever its strain */
#define LATIN_FAR   1e30 /* a length: a strain beyond every gap, for the behaviour of laws at infinity */

/* Returns the tangent stiffness of a link of strain x, elastic, or a spring in the method of multipliers */
static inline PetscReal LatinStructureTangent(const LatinStructure structure, PetscInt l, PetscReal x)
{
  const LatinLaw *law = &LatinLaws[structure->law[l]];

  if (law->rigid) return LatinStructureSpring(structure, l, x) != 0.0 ? structure->penalty[l] : 0.0;
  return law->tangent(structure->stiffness[l], x, law->ctx);
}

/* Whether the link is rigid, and its search parameter automatic */
static inline PetscBool LatinStructureTuned(const LatinStructure structure, PetscInt l)
{
  return (PetscBool)(LatinLaws[structure->law[l]].rigid && !(structure->stiffness[l] > 0.0));
}

/* ---- vectors, elongations and forces; checks of arguments (structure/vectors.c) ---- */
PETSC_INTERN PetscErrorCode LatinCheckArray_Private(MPI_Comm, const char kind[], PetscInt start, PetscInt n, const void *array, const char what[]);
PETSC_INTERN PetscErrorCode LatinCheckNumbers_Private(MPI_Comm, const char kind[], PetscInt start, PetscInt n, PetscInt each, const PetscReal value[], PetscBool negative, const char what[]);
PETSC_INTERN PetscErrorCode LatinStructureCheckComm_Private(LatinStructure, PetscObject solver);
PETSC_INTERN PetscErrorCode LatinStructureCheckSetUp_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureCheckVec_Private(LatinStructure, Vec);
PETSC_INTERN PetscErrorCode LatinStructureCheckMat_Private(LatinStructure, Mat);
PETSC_INTERN PetscErrorCode LatinStructureNodalVec_Private(LatinStructure, const PetscReal values[], Vec);
PETSC_INTERN PetscErrorCode LatinStructureLoads_Private(LatinStructure, Vec more, Vec v);
PETSC_INTERN PetscErrorCode LatinStructureGetLocal_Private(LatinStructure, const PetscReal held[], Vec u, Vec local);
PETSC_INTERN PetscErrorCode LatinStructureOpen_Private(LatinStructure, const PetscReal held[], Vec u, Vec *local, const PetscScalar **a);
PETSC_INTERN PetscErrorCode LatinStructureClose_Private(LatinStructure, Vec *local, const PetscScalar **a);
PETSC_INTERN PetscErrorCode LatinStructureOpenForces_Private(LatinStructure, Vec *local, PetscScalar **f);
PETSC_INTERN PetscErrorCode LatinStructureCloseForces_Private(LatinStructure, Vec *local, PetscScalar **f, Vec u, Vec load, Vec r);
PETSC_INTERN PetscErrorCode LatinStructureElongations_Private(LatinStructure, const PetscReal held[], Vec u, PetscReal e[]);
PETSC_INTERN PetscErrorCode LatinStructureStrains_Private(LatinStructure, Vec u, PetscReal x[]);
PETSC_INTERN PetscErrorCode LatinStructureForces_Private(LatinStructure, const PetscReal tension[], Vec u, Vec load, Vec r);
PETSC_INTERN PetscErrorCode LatinDiagonalProduct_Private(Vec D, Vec u, Vec v, PetscReal *product);

/* ---- rigid laws (structure/rigidlaws.c) ---- */
PETSC_INTERN PetscErrorCode LatinStructureStiffness_Private(LatinStructure, PetscReal scale, PetscReal k[]);
PETSC_INTERN PetscErrorCode LatinStructureRigidScale_Private(LatinStructure, PetscReal *scale);
PETSC_INTERN PetscErrorCode LatinStructureCheckContacts_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureCheckRigid_Private(LatinStructure, const char what[]);
PETSC_INTERN PetscErrorCode LatinStructureCheckHeld_Private(LatinStructure, PetscInt *jam);

/* ---- tangent stiffnesses and their matrix (structure/tangent.c); line search (structure/linesearch.c) ---- */
PETSC_INTERN PetscErrorCode LatinStructureStiffnessRange_Private(LatinStructure, PetscReal *least, PetscReal *most);
PETSC_INTERN PetscErrorCode LatinTangentFind_Private(LatinStructure, Mat, Vec *tangent);
PETSC_INTERN PetscErrorCode LatinTangentCompute_Private(LatinStructure, Vec u, PetscReal floor, Mat, Vec *tangent);
PETSC_INTERN PetscErrorCode LatinTangentGive_Private(LatinStructure, const PetscReal k[], Mat);
PETSC_INTERN PetscErrorCode LatinTangentCreate_Private(LatinStructure, Mat *);
PETSC_INTERN PetscErrorCode LatinTangentChanges_Private(LatinStructure, Vec u, PetscReal floor, Mat, PetscInt *);
PETSC_INTERN PetscErrorCode LatinStructureSearch_Private(LatinStructure, Vec u, Vec step, Vec more, PetscReal *length);
PETSC_INTERN PetscErrorCode LatinStructureResistFar_Private(LatinStructure, Vec step, PetscReal *resisted, PetscReal *borne);

/* ---- residual, tensions, assembly (structure/residual.c, structure/results.c, structure/attach.c); rigid: tensions of rigid links ---- */
PETSC_INTERN PetscErrorCode LatinSolverUnbalance_Private(SNES, LatinStructure, Vec u, Vec r);
PETSC_INTERN PetscErrorCode LatinNoObjective_Private(SNES);
PETSC_INTERN PetscErrorCode LatinStructureResidual_Private(LatinStructure, const PetscReal rigid[], Vec u, Vec r);
PETSC_INTERN PetscErrorCode LatinStructureTensions_Private(LatinStructure, const PetscReal rigid[], Vec u, PetscReal tension[]);
PETSC_INTERN PetscErrorCode LatinStructureDrawn_Private(LatinStructure, PetscReal *norm);
PETSC_INTERN PetscErrorCode LatinStructureAddLinks_Private(LatinStructure, PetscInt i, PetscInt j, PetscReal k, Mat);
PETSC_INTERN PetscErrorCode LatinStructureAssemble_Private(LatinStructure, const PetscReal k[], Mat);
PETSC_INTERN PetscErrorCode LatinStructureCountActive_Private(LatinStructure, const PetscReal rigid[], Vec u, PetscInt *active, PetscInt *unilateral);

/* ---- rotating links (structure/turning*.c, structure/geometric.c); frames (structure/frame.c); cones (structure/frictioncones.c) ---- */
PETSC_INTERN PetscErrorCode LatinTurningSetUp_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinTurningNatural_Private(LatinStructure, const PetscReal e0[]);
PETSC_INTERN PetscErrorCode LatinTurningTensions_Private(LatinStructure, const PetscReal rigid[], Vec u, PetscReal tension[]);
PETSC_INTERN PetscErrorCode LatinTurningAhead_Private(LatinStructure, Vec u, const PetscReal held[], Vec step, PetscReal part, PetscReal tension[], PetscReal strain[]);
PETSC_INTERN PetscErrorCode LatinTurningHeld_Private(LatinStructure, Vec u, const PetscReal held[], Vec r);
PETSC_INTERN PetscErrorCode LatinTurningPressed_Private(LatinStructure, Vec u, Vec v, Vec f);
PETSC_INTERN PetscErrorCode LatinTurningForces_Private(LatinStructure, const PetscReal f[], Vec u, Vec load, Vec r);
PETSC_INTERN PetscErrorCode LatinTurningResidual_Private(LatinStructure, const PetscReal rigid[], Vec u, Vec r);
PETSC_INTERN PetscErrorCode LatinTurningJacobian_Private(LatinStructure, Vec u, Mat J);
PETSC_INTERN PetscErrorCode LatinTurningMove_Private(LatinStructure, const PetscReal held[], Vec u, PetscReal span[], PetscReal x[]);
PETSC_INTERN PetscErrorCode LatinTurningEnergy_Private(LatinStructure, Vec u, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinTurningMatCreate_Private(LatinStructure, Mat *);
PETSC_INTERN PetscErrorCode LatinTurningMatCompute_Private(LatinStructure, Vec u, Mat);
PETSC_INTERN PetscErrorCode LatinStructureCheckLinear_Private(LatinStructure, const char what[]);
PETSC_INTERN PetscErrorCode LatinFrameCreate_Private(LatinStructure, LatinStructure *frame);
PETSC_INTERN PetscErrorCode LatinConesCreate_Private(LatinStructure, LatinStructure *cones);
PETSC_INTERN void           LatinConesTensions(LatinStructure cones, PetscReal tension[]);
PETSC_INTERN PetscErrorCode LatinFrameFollow_Private(LatinStructure frame);
PETSC_INTERN PetscErrorCode LatinFrameRenew_Private(LatinStructure frame, Vec u, LatinFrameType);
PETSC_INTERN PetscErrorCode LatinFrameSprings_Private(LatinStructure frame, PetscBool none);
PETSC_INTERN PetscErrorCode LatinFramePenalty_Private(LatinStructure frame);
PETSC_INTERN PetscErrorCode LatinFrameChanged_Private(LatinStructure frame, const PetscReal strain[], PetscInt *changed);

/* Whether link l has a fixed direction with geometry large: contacts, and links with a direction of their own */
static inline PetscBool LatinStructureKeeps(const LatinStructure structure, PetscInt l)
{
  return structure->keeps ? structure->keeps[l] : PETSC_FALSE;
}

/* ---- the DM (structure/setup.c) ---- */
PETSC_INTERN PetscErrorCode LatinStructureDirections_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureCreateMesh_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureCheckUnlinked_Private(LatinStructure, const PetscReal mass[]);
PETSC_INTERN PetscErrorCode LatinStructureCheckFreeUnlinked_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureComposeDM_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureCloneDM_Private(LatinStructure, DM *);

/* ---- structures in place of others (structure/derived.c) ---- */
PETSC_INTERN void           LatinStructureCopyMembers(LatinStructure, LatinStructure base);
PETSC_INTERN PetscErrorCode LatinStructureDerive_Private(LatinStructure base, const char description[], LatinStructure *);

/* ---- time steps (structure/timestep.c) ---- */
PETSC_INTERN PetscErrorCode LatinStructureInertia_Private(LatinStructure);
PETSC_INTERN PetscErrorCode LatinStepCheck_Private(LatinStructure base);
PETSC_INTERN PetscErrorCode LatinStepCreate_Private(LatinStructure base, LatinStructure *step);
PETSC_INTERN PetscErrorCode LatinStepMade_Private(LatinStructure step, PetscBool *moved);
PETSC_INTERN PetscErrorCode LatinStepBack_Private(LatinStructure step);
PETSC_INTERN PetscErrorCode LatinStepPlaced_Private(LatinStructure step);
PETSC_INTERN PetscErrorCode LatinStepStart_Private(LatinStructure step, PetscReal h, Vec u, Vec v);
PETSC_INTERN PetscErrorCode LatinStepShift_Private(LatinStructure step, PetscReal shift);
PETSC_INTERN PetscErrorCode LatinStepLength_Private(LatinStructure step, PetscReal shift);

/* ---- structures of DMs and solvers (structure/attach.c) ---- */
PETSC_INTERN PetscErrorCode LatinStructureFromDM_Private(DM, LatinStructure *);
PETSC_INTERN PetscErrorCode SNESLatinFindStructure_Private(SNES, LatinStructure *);
PETSC_INTERN PetscErrorCode SNESLatinFollowDM_Private(SNES, LatinStructure);
PETSC_INTERN PetscErrorCode LatinStructureJacobian_SNES(SNES, Vec u, Mat J, Mat P, void *structure);
PETSC_INTERN PetscErrorCode LatinSolverRigid_Private(SNES, LatinStructure, const PetscReal *rigid[]);
PETSC_INTERN PetscErrorCode LatinSolverTensions_Private(SNES, LatinStructure, Vec u, PetscReal tension[]);

#endif
