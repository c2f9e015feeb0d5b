/*
   Subdomains: their links, or the rows of a matrix, and their copies of the nodes; their operators (28) without springs.

   Layout shared by all stages: every subdomain has its own copy of its nodes. The copies here ("here" means on this
   rank) are numbered subdomain by subdomain, and within a subdomain by increasing global node number. Displacement
   component c of copy i is the entry bs * i + c of every "copy array" (U, g, ...), prescribed components included: the
   block size bs counts the components of a node, dim its coordinates; links have as many of both.
*/
#ifndef LATINSUBDOMAINS_H
#define LATINSUBDOMAINS_H

#include "base/collective.h"
#include "base/compat.h"
#include "base/dense.h"
#include "base/fingerprint.h"
#include "base/latinbase.h"
#include "base/rankfailure.h"
#include "structure/structureimpl.h"
#include <petscblaslapack.h>

/* ---- what is known of the unknowns of a matrix (subdomains/matisfields.c): of this rank's part of a vector ---- */
typedef struct {
  PetscInt   dim, fields, nears, kernels;
  PetscReal *x;      /* [rows][dim] */
  PetscInt  *field;  /* [rows] */
  PetscReal *near;   /* [nears][rows] fields near to the kernel: the near null space, or the kernel itself */
  PetscReal *kernel; /* [kernels][rows] of a singular matrix */
} LatinUnknowns;
PETSC_INTERN PetscErrorCode LatinUnknownsSetUp_Private(Mat, DM, Vec coordinates, LatinUnknowns *);
PETSC_INTERN PetscErrorCode LatinUnknownsReset_Private(LatinUnknowns *);

/* ---- the links of each subdomain, and its copies of the nodes (subdomains/subdomains.c) ---- */
typedef struct {
  /* given before the set-up, kept by a reset */
  PetscObject    object;         /* the solver: communicator, prefix and database of options */
  LatinStructure structure;      /* borrowed; NULL: a matrix */
  Mat            matrix;         /* borrowed: a MATIS instead of links, or NULL */
  LatinUnknowns  known;          /* of its unknowns */
  PetscInt       wanted;         /* subdomains to which the pieces of its local matrices are joined; 0: one a rank */
  PetscBool      tangent;        /* linear operators: no link has a state */
  PetscReal     *link_stiffness; /* [links_local of the structure] k; tangent stiffnesses for linear operators; search parameters of rigid links */
  PetscBool      preconditions;  /* one linear stage from zero, in which springs only keep operators regular */
  /* made by the set-up */
  PetscInt   dim, bs;     /* coordinates and components of a node */
  PetscInt   fields;      /* kinds of components, each with macro fields of its own; as many as coordinates: a displacement */
  PetscInt   nodes_local; /* nodes that this rank numbers, roots of node_sf */
  PetscInt  *field;       /* [copies * bs] NULL: the components of a node are the fields */
  PetscInt   nears;       /* fields near to the kernel that are known, [nears][copies * bs] */
  PetscReal *near;
  PetscInt   count, n, first; /* subdomains: all, here, number of the first one here */
  PetscInt  *rank_first;      /* [ranks + 1] first subdomain of each rank */
  PetscInt  *of_link;         /* [structure->links_local] subdomain of the caller's links */
  PetscInt  *link_offset;     /* [n + 1] */
  PetscInt   links;
  PetscInt  *ends;             /* [links][2] copies of the nodes */
  PetscReal *direction;        /* [links][dim] */
  PetscReal *stiffness;        /* [links] k, which is also the ascent direction l */
  PetscReal *e0;               /* [links] */
  PetscInt  *law;              /* [links] */
  PetscReal *part;             /* [links][LATIN_PART] of links that turn far, see structure/turning.h; NULL: there are none */
  PetscReal *friction;         /* [links] coefficient, at the normal part of a contact; NULL if nothing rubs */
  PetscInt  *node_offset;      /* [n + 1] */
  PetscInt   copies;           /* copies of nodes here */
  PetscInt  *node;             /* [copies] global node number */
  PetscReal *x;                /* [copies][dim] coordinates */
  PetscBool *fixed;            /* [copies][bs] */
  PetscReal *prescribed;       /* [copies][bs] */
  PetscInt  *multiplicity;     /* [copies] number of subdomains at the node */
  PetscReal *ground;           /* [copies][bs] springs to the ground, shared among the copies of a node; NULL if there are none */
  PetscInt  *global_dof;       /* [copies][bs] */
  PetscSF    link_sf;          /* caller's links -> links here */
  PetscSF    node_sf;          /* caller's nodes -> copies */
  PetscSF    dof_sf;           /* DM global vector -> free components of copies */
  PetscInt   nonsmooth_global; /* links with a state, over all ranks */
  PetscInt   nonsmooth;        /* links with a state, here */
  PetscInt  *nonsmooth_link;   /* [nonsmooth] */
  PetscInt  *state;            /* [links] number of the link's state here, -1: none */
  PetscInt  *state_first;      /* [n + 1] first state of each subdomain */
  /* subdomains of a matrix (subdomains/matis.c) have no links, and one component a node */
  PetscInt        *ki, *kj; /* [copies + 1], [ki[copies]] rows of the operators, NULL: B^t k B */
  PetscInt        *kd;      /* [copies] where the diagonal is in kj, -1: nowhere; NULL: of a dense matrix */
  PetscReal       *ka;
  Mat              dense;           /* where a local matrix is dense, and its only part a subdomain: in place of kj and ka; else NULL */
  const PetscReal *dense_a;         /* its entries, [copies][copies] */
  PetscInt        *dense_row;       /* [copies] rows of it */
  PetscBool        sums;            /* do several rows of a local matrix have one copy? Entries are added up then */
  PetscInt         rows, *row_copy; /* [rows] of the local matrix: their copies, or why they have none (subdomains/matis.c) */
  /* coupled to no other unknown: rows of a matrix, masses without link in a motion */
  PetscInt   unassigned_count, *unassigned; /* unknowns of this rank's part of a vector that are in no subdomain */
  PetscReal *unassigned_inverse;            /* inverse of their diagonal entries */
} LatinSubdomains;

/* Are the operators those of a tangent stiffness of links that turn, with which Newton's method preconditions its own? */
static inline PetscBool LatinSubdomainsTangent(const LatinSubdomains *sub)
{
  return (PetscBool)(sub->part && sub->structure->made == LATIN_FRAME_TANGENT);
}

/* The rank of a subdomain */
static inline PetscMPIInt LatinSubdomainRank(const LatinSubdomains *sub, PetscMPIInt size, PetscInt s)
{
  PetscMPIInt low = 0, high = size - 1;

  while (low < high) {
    const PetscMPIInt middle = (low + high + 1) / 2;

    if (sub->rank_first[middle] <= s) low = middle;
    else high = middle - 1;
  }
  return low;
}

/* The column of entry k of row i of the operators of a matrix, and its value */
static inline PetscInt LatinEntryColumn(const LatinSubdomains *sub, PetscInt i, PetscInt k)
{
  return sub->dense ? k - sub->ki[i] : sub->kj[k];
}

static inline PetscReal LatinEntry(const LatinSubdomains *sub, PetscInt i, PetscInt k)
{
  return sub->dense ? sub->dense_a[(size_t)sub->copies * (size_t)sub->dense_row[i] + (size_t)sub->dense_row[k - sub->ki[i]]] : sub->ka[k];
}

/* Has a node a free component? */
static inline PetscBool LatinNodeFree(const LatinSubdomains *sub, PetscInt i)
{
  for (PetscInt c = 0; c < sub->bs; c++)
    if (!sub->fixed[sub->bs * i + c]) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* The field of an entry of the copy arrays */
static inline PetscInt LatinField(const LatinSubdomains *sub, PetscInt dof)
{
  return sub->field ? sub->field[dof] : dof % sub->bs;
}

/* Elongation of a link under the displacements of the copies, a row of B */
static inline PetscReal LatinElongation(const LatinSubdomains *sub, PetscInt dim, PetscInt l, const PetscReal U[])
{
  const PetscReal *n = sub->direction + dim * l, *ua = U + dim * sub->ends[2 * l], *ub = U + dim * sub->ends[2 * l + 1];
  PetscReal        e = 0.0;

  for (PetscInt c = 0; c < dim; c++) e += n[c] * (ub[c] - ua[c]);
  return e;
}

PETSC_INTERN PetscErrorCode LatinSubdomainsSetUp(LatinSubdomains *, PetscInt of_link[], PetscInt count);
PETSC_INTERN PetscErrorCode LatinSubdomainsSetUp_Matrix(LatinSubdomains *);
PETSC_INTERN PetscErrorCode LatinSubdomainsRefresh(LatinSubdomains *);
PETSC_INTERN PetscErrorCode LatinSubdomainsRefresh_Matrix(LatinSubdomains *, PetscBool *same);
PETSC_INTERN PetscErrorCode LatinSubdomainsReturn_Private(const LatinSubdomains *, const PetscReal state[], PetscReal value[]);
PETSC_INTERN PetscErrorCode LatinSubdomainsBalance_Private(const LatinSubdomains *, PetscReal *links, PetscReal *dofs, PetscReal *ranks);
PETSC_INTERN PetscErrorCode LatinSubdomainsReset(LatinSubdomains *);
PETSC_INTERN PetscErrorCode LatinDistribute_Private(const LatinSubdomains *, Vec u, PetscReal copy[]);
PETSC_INTERN PetscErrorCode LatinSum_Private(const LatinSubdomains *, const PetscReal copy[], Vec u);
PETSC_INTERN PetscErrorCode LatinUnassigned_Private(const LatinSubdomains *, Vec x, Vec y);

/* The prefix of the options, for messages */
static inline const char *LatinPrefix(const LatinSubdomains *sub)
{
  return sub->object->prefix ? sub->object->prefix : "";
}

/* ---- operators (subdomains/operator.c, subdomains/sparse.c) ---- */
/* The matrix of one subdomain by compressed rows */
typedef struct {
  PetscInt   bs, rows, *i, *j; /* bs rows a node */
  PetscReal *a;
} LatinSparse;
/* A dense symmetric matrix at n entries dof[] of the copy arrays */
typedef struct {
  PetscInt         n;
  const PetscInt  *dof;
  const PetscReal *a;
} LatinBlock;
PETSC_INTERN PetscErrorCode LatinOperatorMult(const LatinSubdomains *, const PetscReal v[], PetscReal f[]);
PETSC_INTERN PetscErrorCode LatinOperatorDiagonal(const LatinSubdomains *, PetscReal diagonal[]);
PETSC_INTERN void           LatinOperatorDense(const LatinSubdomains *, PetscInt s, PetscInt n, const PetscInt position[], PetscReal A[]);
PETSC_INTERN PetscErrorCode LatinOperatorStream_Private(const LatinSubdomains *, PetscInt s, LatinStream *);
PETSC_INTERN PetscErrorCode LatinSparseCreate_Private(const LatinSubdomains *, PetscInt s, const PetscReal spring[], const PetscBool held[], PetscInt blocks, const LatinBlock[], LatinSparse *);
PETSC_INTERN PetscErrorCode LatinSparseRenew_Private(const LatinSubdomains *, PetscInt s, const PetscReal spring[], const PetscBool held[], LatinSparse *, PetscBool *same);
PETSC_INTERN PetscErrorCode LatinSparseReset_Private(LatinSparse *);

#endif
