/*
   Structures of links: constitutive laws, what a structure holds, one time step as a structure of its own.
   Private; latinimpl.h includes it.
*/
#ifndef LATINLINKSIMPL_H
#define LATINLINKSIMPL_H

#include "latinpc.h"
#include <petsc/private/petscimpl.h>
#include <petscdmplex.h>
#include <petscsf.h>

/* ---- constitutive laws (laws.c) ---- */
typedef struct {
  const char *name;
  const char *cure;                                                      /* what to take for a rigid law where a stiffness is needed */
  PetscBool   smooth;                                                    /* a linear law carries no state */
  PetscBool   rigid;                                                     /* the tension is no function of the strain: no tension, tangent, energy */
  PetscReal   stiffness;                                                 /* its own, where a link is given none; 0: it has none */
  PetscReal (*tension)(PetscReal k, PetscReal x, void *ctx);             /* tau for the strain x = e + e0 */
  PetscReal (*tangent)(PetscReal k, PetscReal x, void *ctx);             /* an element of the generalised derivative */
  PetscReal (*energy)(PetscReal k, PetscReal x, void *ctx);              /* the convex potential whose derivative is the tension */
  PetscReal (*local)(PetscReal l, PetscReal e0, PetscReal y, void *ctx); /* local stage: y = tau + l e gives tau_hat - l e_hat; NULL: from the tension */
  void *ctx;
} LatinLaw;
#define LATIN_LAWS_MAX 64
PETSC_INTERN LatinLaw       LatinLaws[];
PETSC_INTERN PetscInt       LatinLawCount;
PETSC_INTERN PetscReal      LatinLawLocal(PetscInt law, PetscReal l, PetscReal e0, PetscReal y);
PETSC_INTERN PetscErrorCode LatinLawsFinalize_Private(void);

/* ---- structures (links.c, linksdata.c) ---- */
struct _p_LatinLinks {
  PETSCHEADER(int);
  PetscInt dim;
  PetscInt nodes_local, nodes_global; /* the caller's nodes: this rank's block, all */
  PetscInt links_local, links_global;
  PetscInt nodes_start, links_start;
  /* the caller's nodes of this rank */
  PetscReal *x, *prescribed, *force; /* [nodes_local][dim] */
  PetscBool *fixed;                  /* [nodes_local][dim] */
  PetscInt  *global_dof;             /* [nodes_local][dim] entry of a DM global vector, -1 where prescribed or without link */
  /* the caller's links of this rank */
  PetscInt  *nodes;                 /* [links_local][2] global node numbers */
  PetscInt  *law;                   /* [links_local] LatinLawType */
  PetscReal *stiffness, *prestrain; /* [links_local] k, e0 */
  PetscReal *direction;             /* [links_local][dim] unit vector from the first to the second node: a row of B is (-n, n) */
  PetscReal *tangent;               /* [links_local] tangent stiffness of the last Jacobian, NULL before */
  PetscReal *friction;              /* [links_local] coefficient, read at the normal part of a contact; NULL if none was given */
  PetscReal *multiplier;            /* [links_local] tensions of the rigid links, of the last solve; NULL if no link is rigid */
  PetscBool *tuned;                 /* [links_local] the search parameter of a rigid link is ours; NULL if no link is rigid */
  PetscReal  tuning;                /* times what rigid.c has chosen, as the structure has shown it (balance.c) */
  PetscInt   rigid_law;             /* law of one of the rigid links of any rank, -1: there is none */
  PetscBool  general, rubs;         /* has laws beyond bars, cables and struts; has contacts with friction, on any rank */
  PetscInt  *subdomain;             /* [links_local] the caller's partition, NULL if none */
  PetscInt   subdomain_count;
  /* the DM and its work space */
  DM               dm;
  PetscSF          vertex_sf;         /* from the caller's nodes to the DM's vertices here */
  PetscInt         vertices;          /* vertices of the DM here */
  PetscInt        *ends;              /* [links_local][2] vertices of the DM */
  PetscReal       *vertex_prescribed; /* [vertices][dim] */
  Vec              load;              /* F at free dofs, DM global vector */
  PetscBool        set_up;
  PetscObjectState load_state, prestrain_state; /* counted up at each change, so that a solver sees what to rebuild */
  /* dynamics (inertia.c), NULL in statics */
  PetscReal       *mass;       /* [nodes_local] */
  Vec              inertia;    /* M at free dofs */
  LatinLinks       base;       /* the structure that this one is a time step of */
  PetscObjectState base_state; /* its state when it was last looked at */
  Vec              ground;     /* springs between the nodes and the ground, at free dofs: M / h^2 of a time step */
  PetscReal        shift;      /* this 1 / h^2 */
};
PETSC_INTERN PetscErrorCode LatinLinksLoadVec_Private(LatinLinks);
PETSC_INTERN PetscBool      LatinUnitVector(PetscInt dim, const PetscReal v[], PetscReal unit[]);
PETSC_INTERN PetscErrorCode LatinLinksSetUpRigid_Private(LatinLinks);
PETSC_INTERN PetscErrorCode LatinLinksTune_Private(LatinLinks);
PETSC_INTERN PetscErrorCode LatinLinksCheckRigid_Private(LatinLinks, const char what[]);
PETSC_INTERN PetscErrorCode LatinLinksCheckContacts_Private(LatinLinks, const PetscInt law[]);
static inline PetscReal     LatinLinksTangent(const LatinLinks links, PetscInt l, PetscReal x)
{
  const LatinLaw *law = &LatinLaws[links->law[l]];

  return law->tangent(links->stiffness[l], x, law->ctx);
}
/* A row of B: the elongation of link l under the vertex displacements a */
static inline PetscReal LatinLinksElongation(LatinLinks links, PetscInt l, const PetscScalar a[])
{
  const PetscInt     dim = links->dim;
  const PetscReal   *n   = links->direction + dim * l;
  const PetscScalar *ua = a + dim * links->ends[2 * l], *ub = a + dim * links->ends[2 * l + 1];
  PetscReal          e = 0.0;

  for (PetscInt c = 0; c < dim; c++) e += n[c] * (ub[c] - ua[c]);
  return e;
}
/* A column of B^t: adds the forces of link l under the tension t to those of the vertices */
static inline void LatinLinksAddForce(LatinLinks links, PetscInt l, PetscReal t, PetscScalar f[])
{
  const PetscInt   dim = links->dim;
  const PetscReal *n   = links->direction + dim * l;
  PetscScalar     *fa = f + dim * links->ends[2 * l], *fb = f + dim * links->ends[2 * l + 1];

  for (PetscInt c = 0; c < dim; c++) {
    fa[c] -= t * n[c];
    fb[c] += t * n[c];
  }
}
/* The tension of a link of the caller: rigid links keep that of the last solve */
static inline PetscReal LatinLinksTension(const LatinLinks links, PetscInt l, PetscReal x)
{
  const LatinLaw *law = &LatinLaws[links->law[l]];

  return law->rigid ? links->multiplier[l] : law->tension(links->stiffness[l], x, law->ctx);
}
PETSC_INTERN PetscErrorCode LatinLinksNodalVec_Private(LatinLinks, const PetscReal values[], Vec);
PETSC_INTERN PetscErrorCode LatinLinksKnowDM_Private(LatinLinks);
PETSC_INTERN PetscErrorCode LatinLinksElongations_Private(LatinLinks, Vec u, PetscReal e[]);
PETSC_INTERN PetscErrorCode LatinLinksCountActive_Private(LatinLinks, Vec u, PetscInt *active, PetscInt *unilateral);
PETSC_INTERN PetscErrorCode LatinLinksInertia_Private(LatinLinks);
PETSC_INTERN PetscErrorCode LatinLinksAddGround_Private(LatinLinks, Vec u, Vec r);
PETSC_INTERN PetscErrorCode LatinLinksGroundEnergy_Private(LatinLinks, Vec u, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinStepCreate_Private(LatinLinks base, LatinLinks *step);
PETSC_INTERN PetscErrorCode LatinStepDestroy_Private(LatinLinks step);
PETSC_INTERN PetscErrorCode LatinStepStart_Private(LatinLinks step, PetscReal h, Vec u, Vec v);
PETSC_INTERN PetscErrorCode LatinStepShift_Private(LatinLinks step, PetscReal shift);
PETSC_INTERN PetscErrorCode LatinStepLength_Private(LatinLinks step, PetscReal shift);
PETSC_INTERN PetscErrorCode LatinLinksFromDM_Private(DM, LatinLinks *);
PETSC_INTERN PetscErrorCode LatinLinksCheckVec_Private(LatinLinks, Vec);
PETSC_INTERN PetscErrorCode LatinLinksGetLocal_Private(LatinLinks, Vec, Vec);
PETSC_INTERN PetscErrorCode LatinLinksSetTangent_Private(LatinLinks, Vec u, PetscReal floor);
PETSC_INTERN PetscErrorCode LatinLinksMultTangent_Private(LatinLinks, Vec x, Vec y);
PETSC_INTERN PetscErrorCode LatinLinksResistFar_Private(LatinLinks, Vec step, PetscReal *resisted);
PETSC_INTERN PetscErrorCode LatinLinksCountChanges_Private(LatinLinks, Vec u, PetscReal floor, PetscInt *);
PETSC_INTERN PetscErrorCode LatinLinksSearch_Private(LatinLinks, Vec u, Vec step, Vec more, PetscReal *length);
PETSC_INTERN PetscErrorCode LatinLinksStiffnessRange_Private(LatinLinks, PetscReal *least, PetscReal *most);

#endif
