/*
   Subdomains: their links, or their rows of a matrix; their copies of nodes; their operators (28) without search directions.

   Common layout: each subdomain has its own copy of its nodes. The copies on this rank are numbered subdomain by subdomain, in each by increasing
   global node number. Component c of copy i is entry bs * i + c of all arrays over copies (U, g, ...), prescribed components included. bs: components
   of a node; dim: its coordinates; links have bs = dim.
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

/* ---- coordinates, fields and near null space of the unknowns of a matrix (subdomains/matisfields.c): this rank's part of vectors ---- */
typedef struct {
  PetscInt   dim, fields, nears, kernels;
  PetscReal *x;      /* [rows][dim] coordinates */
  PetscInt  *field;  /* [rows] field of each unknown */
  PetscReal *near;   /* [nears][rows] near null space; without one, the null space */
  PetscReal *kernel; /* [kernels][rows] null space */
} LatinUnknowns;
PETSC_INTERN PetscErrorCode LatinUnknownsSetUp_Private(Mat, DM, Vec coordinates, LatinUnknowns *);
PETSC_INTERN PetscErrorCode LatinUnknownsReset_Private(LatinUnknowns *);

/* ---- the links of each subdomain, and its copies of the nodes (subdomains/subdomains.c) ---- */
typedef struct {
  /* given before the set-up, kept by a reset */
  PetscObject    object;    /* solver, for its communicator, options prefix and database */
  LatinStructure structure; /* borrowed; NULL: a matrix in its place */
  Mat            matrix;    /* borrowed: a MATIS in place of links, or NULL */
  LatinUnknowns  known;     /* data of the unknowns of the matrix */
  PetscInt       wanted;    /* number of subdomains to make of the pieces of local matrices; 0: one for each rank */
  PetscBool      tangent;   /* whether operators are linearised: no link has a state */
  /*
     [links_local of the structure] k; tangent stiffnesses of linearised operators; of rigid links automatic search parameters, the scale of their
     forces whatever parameters the caller sets
  */
  PetscReal *link_stiffness;
  PetscBool  preconditions; /* whether this is PC latin: one linear stage from zero; springs only keep operators regular */
  /* made by the set-up */
  PetscInt   dim, bs;         /* number of coordinates and components of a node */
  PetscInt   fields;          /* number of fields, each with macro modes of its own; fields == dim: a displacement */
  PetscInt   nodes_local;     /* number of nodes of this rank in the global numbering, roots of node_sf */
  PetscInt  *field;           /* [copies * bs] field of each dof; NULL: its component */
  PetscInt   nears;           /* number of vectors of the near null space */
  PetscReal *near;            /* [nears][copies * bs] near null space */
  PetscInt   count, n, first; /* number of subdomains: on all ranks, here; global number of the first one here */
  PetscInt  *rank_first;      /* [ranks + 1] first subdomain of each rank */
  PetscInt  *of_link;         /* [structure->links_local] subdomain of each link of the structure */
  PetscInt  *link_offset;     /* [n + 1] range of the links of each subdomain */
  PetscInt   links;
  PetscInt  *ends;             /* [links][2] copies of the end nodes */
  PetscReal *direction;        /* [links][dim] unit direction */
  PetscReal *stiffness;        /* [links] k, which is also the ascent direction l */
  PetscReal *e0;               /* [links] */
  PetscInt  *law;              /* [links] */
  PetscReal *part;             /* [links][LATIN_PART] data of links with large rotations, see structure/turning.h; NULL: no such links */
  PetscReal *friction;         /* [links] friction coefficient, at the normal part of a contact; NULL: no friction */
  PetscInt  *node_offset;      /* [n + 1] range of the copies of each subdomain */
  PetscInt   copies;           /* copies of nodes here */
  PetscInt  *node;             /* [copies] global node number */
  PetscReal *x;                /* [copies][dim] coordinates */
  PetscBool *fixed;            /* [copies][bs] */
  PetscReal *prescribed;       /* [copies][bs] */
  PetscInt  *multiplicity;     /* [copies] number of subdomains at the node */
  PetscReal *ground;           /* [copies][bs] springs to the ground, shared equally by the copies of a node; NULL: none */
  PetscInt  *global_dof;       /* [copies][bs] */
  PetscSF    link_sf;          /* links of the structure -> links here */
  PetscSF    node_sf;          /* nodes of the structure -> copies */
  PetscSF    dof_sf;           /* global vector of the DM or the matrix -> free components of copies */
  PetscInt   nonsmooth_global; /* number of links with a state, over all ranks */
  PetscInt   nonsmooth;        /* number of links with a state, here */
  PetscInt  *nonsmooth_link;   /* [nonsmooth] these links */
  PetscInt  *state;            /* [links] number of the link's state here, -1: none */
  PetscInt  *state_first;      /* [n + 1] first state of each subdomain */
  /* subdomains of a matrix (subdomains/matis.c): no links, one component a node */
  PetscInt        *ki, *kj; /* [copies + 1], [ki[copies]] compressed rows of the operators; ki NULL: links, B^t k B */
  PetscInt        *kd;      /* [copies] position of the diagonal entry in kj, -1: none; NULL: dense matrix */
  PetscReal       *ka;
  Mat              dense;     /* dense local matrix that is one subdomain, in place of kj and ka; else NULL */
  const PetscReal *dense_a;   /* [copies][copies] its entries */
  PetscInt        *dense_row; /* [copies] row of dense_a of each copy */
  PetscBool        sums;      /* whether several rows of the local matrix belong to one copy: their entries are summed */
  /* number of rows of the local matrix; [rows] copy of each, negative: none, see LatinMatrixUnknowns_Private() */
  PetscInt rows, *row_copy;
  /* isolated unknowns, in no subdomain: rows of a matrix without coupling, masses without links in a motion */
  PetscInt   unassigned_count, *unassigned; /* number, and local numbers, of these unknowns of this rank */
  PetscReal *unassigned_inverse;            /* inverse of their diagonal entries */
} LatinSubdomains;

/* Whether the operators are tangent stiffnesses of links with large rotations, which precondition Newton's method */
static inline PetscBool LatinSubdomainsTangent(const LatinSubdomains *sub)
{
  return (PetscBool)(sub->part && sub->structure->made >= LATIN_FRAME_TANGENT);
}

/* Whether these may not be positive definite, which is no error: other operators are then made */
static inline PetscBool LatinSubdomainsTried(const LatinSubdomains *sub)
{
  return (PetscBool)(sub->part && sub->structure->made == LATIN_FRAME_TANGENT);
}

/* Returns the rank of subdomain s */
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

/* Return the column and the value of entry k of row i, of the operators of a matrix */
static inline PetscInt LatinEntryColumn(const LatinSubdomains *sub, PetscInt i, PetscInt k)
{
  return sub->dense ? k - sub->ki[i] : sub->kj[k];
}

static inline PetscReal LatinEntry(const LatinSubdomains *sub, PetscInt i, PetscInt k)
{
  return sub->dense ? sub->dense_a[(size_t)sub->copies * (size_t)sub->dense_row[i] + (size_t)sub->dense_row[k - sub->ki[i]]] : sub->ka[k];
}

/* Whether the node of copy i has a free component */
static inline PetscBool LatinNodeFree(const LatinSubdomains *sub, PetscInt i)
{
  for (PetscInt c = 0; c < sub->bs; c++)
    if (!sub->fixed[sub->bs * i + c]) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Returns the field of a dof of the copies */
static inline PetscInt LatinField(const LatinSubdomains *sub, PetscInt dof)
{
  return sub->field ? sub->field[dof] : dof % sub->bs;
}

/* Returns the elongation of link l under the displacements U of the copies, a row of B */
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

/* Returns the prefix of the options, for messages */
static inline const char *LatinPrefix(const LatinSubdomains *sub)
{
  return sub->object->prefix ? sub->object->prefix : "";
}

/* ---- operators (subdomains/operator.c, subdomains/sparse.c) ---- */
/* Matrix of one subdomain by compressed rows */
typedef struct {
  PetscInt   bs, rows, *i, *j; /* rows of a node, and in all; compressed rows */
  PetscReal *a;
} LatinSparse;
/* Dense symmetric n x n matrix at dofs dof[] of the copies */
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
