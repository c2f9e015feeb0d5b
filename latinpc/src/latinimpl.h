/*
   Private structures, one per stage of the method. Equation numbers are those of the article named in
   latinpc.h; "rank" is an MPI process, "here" means on this rank.

   Layout shared by all stages: every subdomain has its own copy of its nodes. The copies here are numbered
   subdomain by subdomain, and within a subdomain by increasing global node number. Displacement component c
   of copy i is the entry bs * i + c of every "copy array" (U, g, ...), prescribed components included: the block size
   bs counts the components of a node, dim its coordinates; links have as many of both.
*/
#ifndef LATINIMPL_H
#define LATINIMPL_H

#include "compat.h"
#include "linksimpl.h"
#include <petsc/private/petscimpl.h>
#include <petscblaslapack.h>
#include <petscdmplex.h>
#include <petscsf.h>
#include <petscsnes.h>
#include <math.h> /* INFINITY: that of PETSc is a large number */

#if defined(PETSC_USE_COMPLEX)
  #error "latinpc needs a PETSc with real scalars: structures have real displacements"
#endif

/* A number that stands for rounding, in double and in single precision */
#if defined(PETSC_USE_REAL_SINGLE)
  #define LatinByPrecision(in_double, in_single) in_single
#else
  #define LatinByPrecision(in_double, in_single) in_double
#endif

PETSC_INTERN PetscClassId  LATIN_CLASSID, LATIN_LINKS_CLASSID;
PETSC_INTERN PetscLogEvent LATIN_SetUp, LATIN_Substructure, LATIN_Interface, LATIN_Direction, LATIN_Macro, LATIN_Floppy, LATIN_Linear, LATIN_Coarse, LATIN_Local, LATIN_Condense, LATIN_Estimate;

/* ---- errors and communication that every rank reaches (collective.c) ---- */
PETSC_INTERN PetscErrorCode LatinAgree_Private(MPI_Comm, PetscBool bad, PetscErrorCode code, const char message[]);
PETSC_INTERN PetscErrorCode LatinSFBcast_Private(PetscSF, PetscInt n, MPI_Datatype, const void *root, void *leaf);
PETSC_INTERN PetscErrorCode LatinSFReduce_Private(PetscSF, PetscInt n, MPI_Datatype, const void *leaf, void *root, MPI_Op);
PETSC_INTERN PetscErrorCode LatinListFirst_Private(MPI_Comm, PetscInt n, const PetscInt mine[], PetscInt first[]);
/* Ends in the same error on every rank of comm when `bad` holds on any of them, with the message of the lowest such rank */
#define LatinAgree(comm, bad, code, ...) \
  do { \
    char latin_message_[512]; \
    latin_message_[0] = 0; \
    if (bad) PetscCall(PetscSNPrintf(latin_message_, sizeof(latin_message_), __VA_ARGS__)); \
    PetscCall(LatinAgree_Private(comm, (PetscBool)(bad), code, latin_message_)); \
  } while (0)

/* Runs what each rank does by itself; an error of any rank becomes one of all, with its message. Collective on comm */
PETSC_INTERN PetscErrorCode LatinAgreeError_Private(MPI_Comm, PetscErrorCode mine);
#define LatinEach(comm, ...) \
  do { \
    const PetscErrorCode latin_ierr_ = __VA_ARGS__; \
    PetscCall(LatinAgreeError_Private(comm, latin_ierr_)); \
  } while (0)

/* Runs a collective call; an error that has not struck every rank of comm ends the program (watch.c) */
PETSC_INTERN PetscErrorCode LatinWatchCreate_Private(MPI_Comm);
PETSC_INTERN PetscErrorCode LatinWatchFinalize_Private(void);
PETSC_INTERN PetscErrorCode LatinWatchWait_Private(MPI_Comm, PetscErrorCode);
PETSC_INTERN void           LatinWatchBegin_Private(void);
PETSC_INTERN PetscErrorCode LatinWatchEnd_Private(MPI_Comm, PetscErrorCode);
#define LatinWatch(comm, ...) \
  do { \
    PetscErrorCode latin_ierr_; \
    LatinWatchBegin_Private(); \
    latin_ierr_ = __VA_ARGS__; \
    latin_ierr_ = LatinWatchEnd_Private(comm, latin_ierr_); \
    PetscCall(latin_ierr_); \
  } while (0)

/* ---- equal things (equal.c) ---- */
typedef struct {
  uint64_t hash;
  PetscInt number;
} LatinKey;
PETSC_INTERN uint64_t  LatinHash(size_t n, const void *);
static inline uint64_t LatinMix(uint64_t h) /* bits that look random: the finaliser of MurmurHash3 */
{
  h ^= h >> 33;
  h *= 0xff51afd7ed558ccdULL;
  h ^= h >> 33;
  h *= 0xc4ceb9fe1a85ec53ULL;
  return h ^ (h >> 33);
}
PETSC_INTERN int            LatinKeyCompare(const void *, const void *); /* for qsort(): by hash, then by number */
PETSC_INTERN PetscErrorCode LatinFindEqual(PetscInt n, const size_t first[], const void *data, PetscInt pattern[]);

/* Sets of numbers that are joined, each known by its least member */
static inline PetscInt LatinRoot(PetscInt parent[], PetscInt i)
{
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

static inline void LatinJoin(PetscInt parent[], PetscInt i, PetscInt j)
{
  const PetscInt a = LatinRoot(parent, i), b = LatinRoot(parent, j);

  parent[PetscMax(a, b)] = PetscMin(a, b);
}

/* ---- substructuring (substructure.c): the links of each subdomain, and its copies of the nodes ---- */
typedef struct {
  PetscInt     dim, bs;     /* coordinates and components of a node */
  PetscInt     fields;      /* kinds of components, each with macro fields of its own; as many as coordinates: a displacement */
  PetscInt     nodes_local; /* nodes that this rank numbers, roots of node_sf */
  PetscInt    *field;       /* [copies * bs] NULL: the components of a node are the fields */
  PetscReal   *trace;       /* [copies * bs][fields][1 + dim] as in LatinUnknowns; NULL: of a node */
  PetscInt     nears;       /* fields near to the kernel that are known, [nears][copies * bs] */
  PetscReal   *near;
  PetscInt     count, n, first; /* subdomains: all, here, number of the first one here */
  PetscInt    *rank_first;      /* [ranks + 1] first subdomain of each rank */
  PetscInt    *of_link;         /* [links->links_local] subdomain of the caller's links */
  PetscInt    *link_offset;     /* [n + 1] */
  PetscInt    *link_source;     /* [links] position in the order of arrival, for refreshing link data */
  PetscInt     links;
  PetscInt    *ends;                                                /* [links][2] copies of the nodes */
  PetscReal   *direction;                                           /* [links][dim] */
  PetscReal   *stiffness;                                           /* [links] k, which is also the ascent direction l */
  PetscReal   *prestrain;                                           /* [links] */
  PetscInt    *law;                                                 /* [links] */
  PetscReal   *friction;                                            /* [links] coefficient, at the normal part of a contact; NULL if nothing rubs */
  PetscReal   *tension;                                             /* [nonsmooth] tau_hat of the last local stage; NULL if no link is rigid */
  PetscInt    *node_offset;                                         /* [n + 1] */
  PetscInt     copies;                                              /* copies of nodes here */
  PetscInt    *node;                                                /* [copies] global node number */
  PetscReal   *x;                                                   /* [copies][dim] coordinates */
  PetscBool   *fixed;                                               /* [copies][bs] */
  PetscReal   *prescribed;                                          /* [copies][bs] */
  PetscInt    *multiplicity;                                        /* [copies] number of subdomains at the node */
  PetscReal   *ground;                                              /* [copies][bs] springs to the ground, shared among the copies of a node; NULL if there are none */
  PetscInt    *global_dof;                                          /* [copies][bs] */
  PetscSF      node_sf;                                             /* caller's nodes -> copies */
  PetscSF      dof_sf;                                              /* DM global vector -> free components of copies */
  PetscInt     nonsmooth_global;                                    /* links with a state, over all ranks */
  PetscInt     nonsmooth;                                           /* links with a state, here */
  PetscInt    *nonsmooth_link;                                      /* [nonsmooth] */
  PetscInt    *state;                                               /* [links] number of the link's state here, -1: none */
  PetscInt    *state_first;                                         /* [n + 1] first state of each subdomain */
  PetscMPIInt *send_count, *send_offset, *recv_count, *recv_offset; /* migration of link data, in links */
  PetscInt    *send_order;                                          /* [links->links_local] */
  /* substructures of a matrix (matis.c) have no links, and one component a node */
  PetscInt  *ki, *kj; /* [copies + 1], [ki[copies]] rows of the operators, NULL: B^t k B */
  PetscReal *ka;
  PetscInt   loose_count, *loose; /* unknowns of this rank's part of a vector that are in no subdomain */
  PetscReal *loose_inverse;       /* what the preconditioner makes of them */
} LatinSubstructure;

/* ---- what is known of the unknowns of a matrix (unknowns.c): of this rank's part of a vector ---- */
typedef struct {
  PetscInt   dim, fields, nears, kernels;
  PetscReal *x;      /* [rows][dim] */
  PetscInt  *field;  /* [rows] */
  PetscReal *near;   /* [nears][rows] fields near to the kernel: the near null space, or the kernel itself */
  PetscReal *kernel; /* [kernels][rows] of a singular matrix */
  /*
     [rows][fields][1 + dim] of the unknowns of a coarse problem, which belong to no field: what a unit translation of a
     field, and each of its unit gradients around x, make of the unknown. NULL: 1 and 0 for the unknown's own field.
  */
  PetscReal *trace;
} LatinUnknowns;
PETSC_INTERN PetscErrorCode LatinUnknownsSetUp_Private(Mat, DM, PetscInt dim, PetscInt nodes, const PetscReal x[], LatinUnknowns *);
PETSC_INTERN PetscErrorCode LatinUnknownsReset_Private(LatinUnknowns *);

/* ---- partitions (partition.c, size.c, metis.c, repair.c): links to share out, all on one rank ---- */
typedef struct {
  PetscInt   dim, nodes, links, parts;
  PetscInt  *ends;      /* [links][2] */
  PetscReal *x;         /* [nodes][dim] */
  PetscReal *direction; /* [links][dim] */
  PetscBool *fixed;     /* [nodes][dim] */
  PetscBool  corners;   /* nodes of three or more subdomains have one displacement, a coarse unknown */
} LatinCut;
PETSC_INTERN PetscErrorCode LatinIncidence_Private(const LatinCut *, PetscInt *offset[], PetscInt *incident[]);
PETSC_INTERN PetscErrorCode LatinMetis_Private(LatinCut *, PetscInt part[], PetscBool *failed, int *status, PetscBool *overflow);
PETSC_INTERN PetscErrorCode LatinSubdomainCount_Private(const LatinCut *, PetscInt *parts);
PETSC_INTERN PetscErrorCode LatinRepair_Private(const LatinCut *, PetscInt part[]);

/* The rank of a subdomain */
static inline PetscMPIInt LatinSubdomainRank(const LatinSubstructure *sub, PetscMPIInt size, PetscInt s)
{
  PetscMPIInt low = 0, high = size - 1;

  while (low < high) {
    const PetscMPIInt middle = (low + high + 1) / 2;

    if (sub->rank_first[middle] <= s) low = middle;
    else high = middle - 1;
  }
  return low;
}

/* Has a node a free component? */
static inline PetscBool LatinNodeFree(const LatinSubstructure *sub, PetscInt i)
{
  for (PetscInt c = 0; c < sub->bs; c++)
    if (!sub->fixed[sub->bs * i + c]) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* The field of an entry of the copy arrays */
static inline PetscInt LatinField(const LatinSubstructure *sub, PetscInt dof)
{
  return sub->field ? sub->field[dof] : dof % sub->bs;
}

/* Elongation of a link under the displacements of the copies, a row of B */
static inline PetscReal LatinElongation(const LatinSubstructure *sub, PetscInt dim, PetscInt l, const PetscReal U[])
{
  const PetscReal *n = sub->direction + dim * l, *ua = U + dim * sub->ends[2 * l], *ub = U + dim * sub->ends[2 * l + 1];
  PetscReal        e = 0.0;

  for (PetscInt c = 0; c < dim; c++) e += n[c] * (ub[c] - ua[c]);
  return e;
}

/* ---- interfaces (interface.c): classes, primal nodes, sides and their mates ---- */
/* Where an interface lies; coordinates relative to one of its nodes, so that equal shapes give equal bits */
typedef struct {
  PetscReal origin[3], centre[3]; /* one node; the mean of all, from there */
  PetscReal axes[3][3];           /* xi, eta, zeta: principal axes, by decreasing extent */
  PetscReal size;
  PetscBool strong;
  PetscBool plane; /* all nodes have the same zeta (in 2D, eta) */
} LatinFrame;

typedef struct {
  PetscInt  sub;                   /* subdomain here (local number) */
  PetscInt  neighbour;             /* subdomain on the other side (global number) */
  PetscInt  node_first, node_last; /* its copies: node_list[first..last) */
  PetscBool strong;
  PetscInt  side_first, side_last; /* its degrees of freedom among the side dofs */
  PetscInt  modes;                 /* macro modes kept */
  PetscInt  matrix_first;          /* where the matrix of its search direction starts, -1: the direction is diagonal */
  PetscInt  basis_first;           /* where its rows of R start in the macro bases */
  PetscInt  coarse_first;          /* global number of the first one in the coarse problem */
  PetscInt  local_first;           /* position of the first one among the coarse dofs of the subdomains here */
} LatinInterface;

typedef struct {
  PetscInt        count;        /* interface sides here */
  LatinInterface *interface;    /* [count] sorted by subdomain, then neighbour */
  PetscInt       *offset;       /* [subdomains + 1] */
  PetscInt       *node_list;    /* copies, interface by interface */
  PetscInt       *share_offset; /* [copies + 1] into share_* */
  PetscInt       *share_list;   /* subdomains at the node of the copy, increasing */
  PetscInt       *node_class;   /* [copies] 0 interior, 1 strong, 2 weak, 3 primal */
  PetscInt       *component;    /* [copies] position in share_list of the first subdomain of the copy's primal component, -1 if not primal */
  PetscInt       *position;     /* [copies] position of the copy's own subdomain in share_list */
  PetscBool      *glued;        /* [copies] the node has a primal component, this copy's or another one */
  PetscInt        sides;        /* side degrees of freedom here */
  PetscInt       *side_dof;     /* [sides] entry of the copy arrays */
  PetscBool      *serves;       /* [sides] macro modes of the interface must be visible here */
  PetscSF         mate_sf;      /* side dof -> its mate on the other side of the interface */
  PetscInt        strong_global, weak_global, side_nodes_global;
  /* a table of m x m integers for the m subdomains of a node: each copy fills its own row, and all copies get the whole */
  PetscSF   table_sf;
  PetscInt *table_offset; /* [copies + 1] into the tables of this rank's shared copies */
  PetscInt  table_roots;
} LatinInterfaces;

/* ---- search direction and macro bases (direction.c, macro.c) ---- */
typedef struct {
  PetscReal *d;      /* [sides] micro search direction, force/length; of a matrix, its diagonal */
  PetscReal *soft;   /* [sides] stiffness of both subdomains there, the softer one counting most */
  PetscReal *matrix; /* matrix directions: D, L of D = L L^t, L^-1, column-major; equal ones are stored once; NULL if there is none */
  PetscReal *basis;  /* R of each interface from basis_first on, [side dofs of the interface][modes], with R^t D R = 1 */
  PetscReal *dual;   /* D R, in the same places */
  PetscReal *own;    /* stiffness S of the subdomains themselves on each interface, column-major; NULL: not kept */
  size_t    *own_first;
  PetscReal  mean;  /* D is so many times the sum of both sides' S */
  PetscInt   whole; /* interfaces whose search direction is a matrix, over all ranks */
  PetscInt  *like;  /* [subdomains] the first one with an equal operator and equal sides; NULL: not compared */
} LatinMacro;

/* The row of R at a side dof of the interface */
static inline const PetscReal *LatinMacroRow(const LatinMacro *macro, const LatinInterface *face, PetscInt side)
{
  return macro->basis + face->basis_first + (side - face->side_first) * face->modes;
}

/* The row of D R there: what unit macro forces do */
static inline const PetscReal *LatinMacroDualRow(const LatinMacro *macro, const LatinInterface *face, PetscInt side)
{
  return macro->dual + face->basis_first + (side - face->side_first) * face->modes;
}

/* ---- local low-energy fields (floppy.c) ---- */
typedef struct {
  PetscInt     *modes; /* [subdomains] low-energy modes found */
  PetscInt     *count; /* [interface sides] fields of both subdomains there */
  PetscScalar **field; /* [interface sides][count] columns, rows weighted by sqrt(d) */
  PetscInt      macro; /* macro modes that they have added, over all ranks */
  PetscBool     known; /* is it known which links are slack? */
  PetscBool    *slack; /* [links] left out of the stiffness */
} LatinFloppy;

/* ---- solvers of the subdomains (blocks.c) ---- */
/*
   Subdomains whose operators are equal to the bit share one: a batch of one pattern and many members. The others form
   batches of many patterns and one member each, block diagonal matrices.
*/
typedef struct {
  PetscInt  patterns, members; /* one of them is 1 */
  PetscInt *sub;               /* [patterns * members] subdomains; the first one of each pattern represents it */
  PetscInt *row;               /* [patterns + 1] first row of each pattern in the matrix */
  PetscBool alike;             /* one pattern, and the links of all members have the same laws and the same order of states */
} LatinBatch;

typedef struct {
  PetscInt    n;
  LatinBatch *batch;
  PetscInt   *pattern; /* [subdomains] the subdomain that represents it */
} LatinBlocks;

/* Everything that the operators of a subdomain depend on, as one stream of bytes: hashed, or compared with another's */
typedef struct {
  uint64_t       hash;
  unsigned char *bytes;
  size_t         used, size;
} LatinStream;

/* How a factorisation ended on this rank */
typedef struct {
  PetscErrorCode ierr;
  PCFailedReason failed;
  PetscBool      mechanism;
} LatinFactorStatus;

/* ---- approximate solvers (inexact.c) ---- */
#define LATIN_INEXACT_RTOL     LatinByPrecision(1e-10, 1e-5) /* of an iterative solver where it is taken to be exact */
#define LATIN_INEXACT_HARMLESS 1e-4                          /* asymmetry or variation of a preconditioner that Krylov methods bear */

/* How far solvers are from a symmetric and from a linear operator, 0 for direct ones */
typedef struct {
  PetscReal asymmetry, variation;
} LatinInexact;

/* One matrix and KSP a batch; rows are the copy arrays' entries of the patterns */
typedef struct {
  PetscInt    n;
  PetscBool   direct;    /* all of them are factorisations */
  Mat        *K, *B, *X; /* operator; right-hand sides and solutions of some members, dense */
  KSP        *ksp;
  Vec        *b, *x;    /* the same for a batch of one member */
  PetscInt  **ci, **cj; /* rows of K */
  PetscReal **ca;
} LatinBlockSolver;

/* ---- rows of the subdomains' stiffness (graph.c) ---- */
typedef struct {
  PetscInt  *offset, *list;           /* links at each copy */
  PetscInt  *neighbour;               /* work: copies joined to one copy, itself included */
  PetscReal *block;                   /* work: their bs x bs blocks */
  PetscInt  *slot;                    /* [copies] work: position among the neighbours, -1 */
  PetscInt  *face_offset, *face_list; /* interfaces with a matrix for a search direction at each copy; NULL if there is none */
} LatinGraph;

/* ---- linear stage (linear.c, condense.c): operators of the subdomains ---- */
#define LATIN_LANES          8  /* equal subdomains whose links are swept together */
#define LATIN_BLOCK_COLUMNS  64 /* equal subdomains solved together: right-hand sides stay in cache */
#define LATIN_BLOCK_PATTERNS 64 /* different subdomains in one matrix: no more of them than condensation likes */

typedef struct {
  LatinBlocks      blocks;
  LatinBlockSolver solver;
  PetscInt        *primal_offset; /* [subdomains + 1] primal dofs of each subdomain */
  PetscInt        *primal_dof;    /* entries of the copy arrays */
  PetscInt        *primal_index;  /* [copies * bs] position in its subdomain's primal list, -1 if not primal */
  /* the following are stored once for each pattern, and found by subdomain */
  PetscInt   *rc_first, *rc_last; /* [subdomains] coupling of the other dofs with the primal ones */
  PetscInt   *rc_row, *rc_col;    /* row from the subdomain's first one, position in its primal list */
  PetscReal  *rc_value;
  size_t     *h_offset, *phi_offset; /* [subdomains] into H and Phi */
  PetscReal  *H;                     /* homogenised stiffness (51), column-major */
  PetscReal  *Phi;                   /* displacements for unit coarse displacements, (bs * nodes) x coarse, column-major */
  PetscReal **inverse;               /* [batches] displacements for unit forces with the coarse ones held, dense; NULL: from the solver */
  PetscReal  *g;                     /* [copies * bs] forces of a linear stage, work space after it */
  PetscReal  *U;                     /* [copies * bs] displacements, the sum of those of all linear stages */
  PetscReal  *pull;                  /* [sides] forces of the search direction, D times the micro part of U */
  PetscReal  *load;                  /* [copies * bs] F, shared among the copies of a node */
  PetscReal  *spring;                /* [copies * bs] springs of the search direction, part of K */
  PetscReal  *lambda;                /* work: macro forces of one subdomain */
  PetscReal  *tile;                  /* work: displacements and forces of LATIN_LANES equal subdomains, see sweep.c */
  PetscInt    widest;                /* most coarse dofs of a subdomain here */
} LatinLinear;

/* ---- nested condensation of the coarse problem (nested.c) ---- */
#define LATIN_NEST_LEVELS 8

/* Subdomains, or groups of them, seen from the coarse problem; equal ones share an operator */
typedef struct {
  PetscInt   n;
  PetscInt  *offset;   /* [n + 1] coarse dofs of each element */
  PetscInt  *dof;      /* [offset[n]] their numbers on this rank */
  PetscInt  *pattern;  /* [n] the first element equal to each */
  size_t    *h_offset; /* [n] into H */
  PetscReal *H;        /* operators, column-major, one for each pattern */
  PetscReal *box;      /* [n][2][3] lowest and highest coordinates */
  PetscReal *q, *u;    /* [offset[n]] forces and displacements, element by element */
} LatinElements;

typedef struct {
  LatinElements fine, coarse;             /* what the groups are made of; the groups */
  PetscInt      groups, *first, *member;  /* [groups + 1], [fine.n] */
  PetscInt     *interior;                 /* [groups] dofs that are eliminated */
  PetscInt     *slot;                     /* [fine.offset[fine.n]] dof of the group: interior ones, then coarse.dof */
  PetscInt      patterns, *pattern_first; /* [patterns + 1] into pattern_group */
  PetscInt     *pattern_group;            /* [groups] by pattern */
  size_t       *l_offset, *v_offset;      /* [patterns] into L, [patterns + 1] into v */
  PetscReal    *L, *v, *work;             /* factors L and Z of each pattern; forces on interior dofs */
} LatinNestLevel;

/* ---- the coarse problem as a matrix that has a decomposition of its own (multilevel.c) ---- */
typedef struct {
  LatinUnknowns known;
  Mat           K;      /* groups of subdomains here, block diagonal; NULL unless the coarse solver is of type latin */
  PetscInt     *global; /* [rows of K] row of the coarse matrix */
  PetscInt     *part;   /* [rows of K] connected part of a group */
  PetscInt      parts;
} LatinLevel;

/* ---- coarse problem (coarse.c), (30) and (52) ---- */
typedef struct {
  Mat            A;
  KSP            ksp;
  Vec            rhs, sol;
  PetscInt       levels; /* of nested condensation */
  LatinNestLevel level[LATIN_NEST_LEVELS];
  LatinElements  top;   /* elements of A: subdomains, or groups of them */
  LatinNestLevel group; /* groups that a coarse solver of type latin takes for subdomains */
  LatinLevel     above;
  PetscInt       top_local, top_size;       /* rows of A: of this rank, all */
  PetscInt      *top_global;                /* [top.offset[top.n]] rows of A */
  PetscSF        top_sf;                    /* coarse vector -> dofs of the elements here */
  PetscSF        sf;                        /* all coarse dofs -> coarse dofs of the subdomains here */
  PetscInt       macro_local, primal_local; /* numbered by this rank: macro modes, then primal displacements */
  PetscInt       macro_global, primal_global;
  PetscBool      whole; /* A, rhs and sol are the whole of it on each rank (whole.c) */
  PetscMPIInt    whole_rank;
  PetscMPIInt   *whole_count, *whole_first; /* [ranks], [ranks + 1] dofs of the elements of each rank */
  PetscInt      *whole_row;                 /* [whole_first[ranks]] rows of A */
  PetscScalar   *whole_q;                   /* [whole_first[ranks]] work: forces of all elements */
  PetscInt      *whole_i, *whole_j;         /* A by rows, NULL: dense */
  PetscScalar   *whole_a;
  PetscInt      *rank_start;  /* [ranks + 1] global number of each rank's first one */
  PetscInt      *offset;      /* [subdomains + 1] coarse dofs of each subdomain: macro modes, then primal dofs */
  PetscInt      *macro_count; /* [subdomains] how many of them are macro modes */
  PetscInt      *global;      /* [offset[n]] their global numbers */
  PetscReal     *q, *u;       /* [offset[n]] condensed forces and coarse displacements of one linear stage, subdomain by subdomain */
} LatinCoarse;

typedef struct _n_LatinInterior *LatinInterior; /* the inside of the subdomain here (interior.c) */

struct _p_Latin {
  PETSCHEADER(int);
  LatinLinks         links;
  LatinVariant       variant;
  LatinModesType     modes;
  PetscBool          published;           /* keep micro springs on primal dofs, as (28) does */
  PetscBool          promote;             /* every node of three or more subdomains is a corner */
  PetscInt           subdomains;          /* asked for, 0 = from links_per_subdomain */
  PetscInt           links_per_subdomain; /* 0 = what costs least */
  PetscBool          repair;              /* the partition of METIS */
  LatinDirectionType direction;
  PetscReal          direction_scalar;   /* 0 = self-tuned */
  PetscReal          direction_fraction; /* of the stiffness seen at the interface, when self-tuned; 0 = the default of the type */
  PetscInt           coarse_groups;      /* width of the groups of nested.c in elements, 1 = none */
  PetscReal          local_threshold;    /* of the eigenvalues of local fields, 0 = none */
  PetscBool          local_given;        /* the threshold has been given */
  PetscInt           local_max;          /* most of them a subdomain */
  PetscInt           local_slack;        /* linear stages that tell which links are slack, 0 = taut as they are */
  Mat                matrix;             /* a MATIS instead of links, or NULL */
  LatinUnknowns      known;              /* of its unknowns */
  PetscBool          share;              /* keep what LatinDirectionShare() needs */
  PetscBool          tangent;            /* operators from the links' tangent stiffness of the last Jacobian */
  PetscBool          condense;           /* the insides of subdomains may be eliminated first */
  LatinInterior      interior;           /* what has been eliminated here, NULL: nothing */
  PetscBool          preconditions;      /* one linear stage from zero, in which springs only keep operators regular */
  LatinSubstructure  sub;
  LatinInterfaces    inter;
  LatinMacro         macro;
  LatinFloppy        floppy;
  LatinLinear        linear;
  LatinCoarse        coarse;
  PetscReal          scale;        /* displacements and gaps of the subdomains over those of the structure, 1 but for rigid links (balance.c) */
  PetscInt           applications; /* linear stages done since the last reset of the counter */
  PetscBool          set_up;
  LatinInexact       inexact; /* of the inner solvers of a preconditioner, on this rank */
  PetscBool          failed;  /* an inner solver failed on this rank, in the last application of a SNES or a PC, or in this solve of a KSP */
  PetscObjectState   load_state, prestrain_state, links_state;
  PetscReal         *outgoing;       /* [sides] work: the data that the mates receive */
  PetscReal         *direction_work; /* work: two blocks of vectors on an interface, one for each subdomain that is treated together */
  PetscReal          indicator;      /* of the last application, relative */
  PetscReal          distance;       /* the same, not divided: square root of an energy */
  PetscReal          noise;          /* what rounding alone leaves of it */
  PetscBool          stale;          /* options have changed since the set-up */
};

PETSC_INTERN LatinDirectionType LatinDirectionKind(Latin);

PETSC_INTERN PetscErrorCode LatinCreate_Private(MPI_Comm, Latin *);
PETSC_INTERN PetscErrorCode LatinSetLinks_Private(Latin, LatinLinks);
PETSC_INTERN PetscErrorCode LatinSetFromOptions_Private(Latin, LatinOptionItems, const char family[]);
PETSC_INTERN PetscErrorCode LatinFindLinks_Private(PetscObject, const char[], LatinLinks, DM, Mat, LatinLinks *);
PETSC_INTERN PetscErrorCode LatinSetMatrix_Private(Latin, Mat);
PETSC_INTERN PetscErrorCode LatinLoose_Private(Latin, Vec x, Vec y);
PETSC_INTERN PetscErrorCode LatinSetUp_Private(Latin);
PETSC_INTERN PetscErrorCode LatinAdapt_Private(Latin);
PETSC_INTERN PetscErrorCode LatinReset_Private(Latin);
PETSC_INTERN PetscErrorCode LatinView_Private(Latin, PetscViewer);
PETSC_INTERN PetscErrorCode LatinDestroy_Private(Latin *);

PETSC_INTERN PetscErrorCode LatinSubstructureSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinSubstructureSetUp_Matrix(Latin);
PETSC_INTERN PetscErrorCode LatinSubstructureRefresh(Latin);
PETSC_INTERN PetscErrorCode LatinSubstructureReset(Latin);
PETSC_INTERN PetscErrorCode LatinSubstructureReturn_Private(Latin);
PETSC_INTERN PetscErrorCode LatinSubstructureBalance_Private(Latin, PetscReal *links, PetscReal *dofs, PetscReal *ranks);
PETSC_INTERN PetscErrorCode LatinPartition_Private(Latin);
PETSC_INTERN PetscErrorCode LatinInterfaceSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinInterfaceReset(Latin);
PETSC_INTERN PetscErrorCode LatinInterfaceExchange_Private(Latin, PetscInt table[]);
PETSC_INTERN PetscErrorCode LatinInterfaceFrame_Private(const LatinSubstructure *, PetscInt n, const PetscInt copies[], LatinFrame *);
PETSC_INTERN PetscErrorCode LatinDirectionSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinDirectionReset(Latin);
PETSC_INTERN PetscReal      LatinDirectionFraction(Latin);
PETSC_INTERN PetscErrorCode LatinDirectionApply(Latin, const LatinInterface *, PetscInt n, const PetscReal x[], PetscInt ldx, PetscReal y[], PetscInt ldy);
PETSC_INTERN PetscErrorCode LatinDirectionEnergy(Latin, const LatinInterface *, PetscInt n, const PetscReal a[], const PetscReal b[], PetscInt ld, PetscReal *sum);
PETSC_INTERN PetscErrorCode LatinDirectionShare(Latin, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[]);
PETSC_INTERN PetscErrorCode LatinDirectionNormalise(Latin, const LatinInterface *, PetscInt modes, PetscReal R[]);
PETSC_INTERN PetscErrorCode LatinDirectionSprings_Private(Latin, PetscReal spring[]);
PETSC_INTERN void           LatinDirectionRow(Latin, const LatinInterface *, PetscInt r, const PetscReal *row[]);
PETSC_INTERN PetscErrorCode LatinStiffnessFaces_Private(Latin, const PetscBool whole[], size_t first[], PetscReal **S);
PETSC_INTERN PetscErrorCode LatinJumps_Private(Latin, PetscBool rough[]);
PETSC_INTERN PetscErrorCode LatinJumpsFaces_Private(Latin, PetscBool whole[]);
PETSC_INTERN PetscErrorCode LatinGraphCreate_Private(Latin, PetscBool with_faces, LatinGraph *);
PETSC_INTERN PetscErrorCode LatinGraphRow_Private(Latin, LatinGraph *, PetscInt i, const PetscReal spring[], PetscInt *count);
PETSC_INTERN PetscErrorCode LatinGraphDestroy_Private(LatinGraph *);
PETSC_INTERN PetscErrorCode LatinOperatorMult(Latin, const PetscReal v[], PetscReal f[]);
PETSC_INTERN PetscErrorCode LatinOperatorDiagonal(Latin, PetscReal diagonal[]);
PETSC_INTERN PetscErrorCode LatinOperatorRowsCreate_Private(Latin, LatinGraph *, PetscInt *widest);
PETSC_INTERN PetscErrorCode LatinOperatorRowsDestroy_Private(LatinGraph *);
PETSC_INTERN void           LatinOperatorRowJoin(Latin, LatinGraph *, PetscInt i, PetscInt *n);
PETSC_INTERN void           LatinOperatorRowAdd(Latin, LatinGraph *, PetscInt i);
PETSC_INTERN PetscErrorCode LatinOperatorStream_Private(Latin, PetscInt s, LatinStream *);
PETSC_INTERN PetscErrorCode LatinMacroSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinMacroDual_Private(Latin);
PETSC_INTERN PetscErrorCode LatinMacroReset(Latin);
PETSC_INTERN PetscErrorCode LatinSVD_Private(PetscInt rows, PetscInt modes, const PetscScalar A[], PetscReal s[], PetscScalar V[]);
PETSC_INTERN void           LatinCombine_Private(PetscInt rows, PetscInt modes, PetscInt n, const PetscScalar A[], const PetscScalar V[], const PetscReal scale[], PetscScalar out[]);
PETSC_INTERN PetscErrorCode LatinFloppySetUp(Latin);
PETSC_INTERN PetscErrorCode LatinFloppyExtend(Latin, PetscInt f, PetscInt rows, PetscInt *fields, PetscScalar F[]);
PETSC_INTERN PetscErrorCode LatinFloppyStatistics_Private(Latin, PetscInt *subdomains, PetscInt *most);
PETSC_INTERN PetscReal      LatinFloppyThreshold(Latin);
PETSC_INTERN PetscBool      LatinFloppyWaits(Latin);
PETSC_INTERN PetscErrorCode LatinFloppySlack(Latin);
PETSC_INTERN PetscErrorCode LatinFloppyReset(Latin);
PETSC_INTERN PetscErrorCode LatinLinearSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinCondenseSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinLinearSetLoads(Latin, Vec load);
PETSC_INTERN PetscErrorCode LatinLinearReset(Latin);
PETSC_INTERN PetscErrorCode LatinLinearApply(Latin, PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinDirectSolverAvailable_Private(Mat, MatSolverType, MatSolverType *, PetscBool *);
PETSC_INTERN PetscErrorCode LatinDenseCreate_Private(PetscInt, PetscInt, Mat *);
PETSC_INTERN PetscErrorCode LatinDenseSolve_Private(KSP, Mat B, Mat X, KSPConvergedReason *failed);
PETSC_INTERN PetscErrorCode LatinDirectSolver_Private(PC, Mat, MatSolverType preferred);
PETSC_INTERN PetscErrorCode LatinFactor_Private(KSP, Mat, MatSolverType, LatinFactorStatus *, Vec *soft);
PETSC_INTERN PetscErrorCode LatinFactorAgree_Private(Latin, const LatinFactorStatus *, Vec soft, const LatinBatch *, const char name[]);
PETSC_INTERN PetscErrorCode LatinStreamRoom_Private(LatinStream *, size_t, unsigned char **);
PETSC_INTERN PetscErrorCode LatinStreamAdd_Private(LatinStream *, const void *data, size_t);
PETSC_INTERN PetscInt       LatinBatchRun(const LatinBatch *, PetscInt m);
PETSC_INTERN PetscErrorCode LatinBlocksSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinBlocksCompare_Private(Latin, PetscBool bases, PetscInt pattern[]);
PETSC_INTERN PetscErrorCode LatinBlocksReset(Latin);
PETSC_INTERN PetscErrorCode LatinBlockSolverCreate(Latin, LatinBlockSolver *);
PETSC_INTERN PetscErrorCode LatinBlockSolverSetUp(Latin, LatinBlockSolver *, const char name[]);
PETSC_INTERN PetscErrorCode LatinBlockSolve(Latin, LatinBlockSolver *, const PetscReal g[], PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinBlockSolveBatch_Private(Latin, LatinBlockSolver *, PetscInt batch, const PetscReal g[], PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinSolverDirect_Private(KSP, PetscBool *);
PETSC_INTERN PetscErrorCode LatinSolverNote_Private(Latin, KSP);
PETSC_INTERN PetscErrorCode LatinSolverDefaults_Private(Latin, KSP, const char name[], PetscBool *direct);
PETSC_INTERN PetscErrorCode LatinSolverAccurate_Private(Latin, KSP, KSP *accurate);
PETSC_INTERN PetscErrorCode LatinSolverTest_Private(KSP, Mat, LatinInexact *);
PETSC_INTERN PetscErrorCode LatinInexactCheck_Private(Latin, KSP, const LatinInexact *);
PETSC_INTERN PetscErrorCode LatinInexactSolve_Private(Latin, PetscInt batch, PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinBlockSolverDestroy(LatinBlockSolver *);
PETSC_INTERN PetscErrorCode LatinCoarseNumber(Latin);
PETSC_INTERN PetscErrorCode LatinCoarseSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinCoarseReset(Latin);
PETSC_INTERN PetscErrorCode LatinCoarseSolve(Latin);
PETSC_INTERN PetscErrorCode LatinCoarseExpand_Private(Latin, Vec);
PETSC_INTERN PetscErrorCode LatinOptionsMention_Private(Latin, const char part[], const char except[], PetscBool *);
PETSC_INTERN PetscErrorCode LatinInteriorSetUp(Latin);
PETSC_INTERN PetscErrorCode LatinInteriorReset(Latin);
PETSC_INTERN PetscBool      LatinInteriorRough(Latin, PetscInt copy);
PETSC_INTERN PetscErrorCode LatinInteriorForces(Latin, Vec forces, PetscReal f[]);
PETSC_INTERN PetscErrorCode LatinInteriorExtend(Latin, const PetscReal v[], Vec u);
PETSC_INTERN PetscErrorCode LatinJumpsCopies_Private(Latin, PetscBool rough[]);
PETSC_INTERN PetscErrorCode LatinWholeWanted_Private(Latin, PetscBool *);
PETSC_INTERN PetscErrorCode LatinWholeAssemble_Private(Latin);
PETSC_INTERN MatSolverType  LatinWholePackage(Latin);
PETSC_INTERN PetscErrorCode LatinWholeForces_Private(Latin, PetscScalar b[]);
PETSC_INTERN PetscErrorCode LatinWholeReset(Latin);
PETSC_INTERN PetscErrorCode LatinNestSetUp(Latin, PetscInt width, PetscBool condense);
PETSC_INTERN PetscErrorCode LatinLevelSubassemble_Private(Latin, Mat *);
PETSC_INTERN PetscErrorCode LatinLevelSetUp_Private(Latin, Mat);
PETSC_INTERN PetscErrorCode LatinLevelBatch_Private(Latin, const LatinBatch *, Mat);
PETSC_INTERN PetscErrorCode LatinLevelElements_Private(Latin, Mat);
PETSC_INTERN PetscErrorCode LatinLevelOf_Private(Mat, LatinLevel **);
PETSC_INTERN PetscErrorCode LatinLevelReset_Private(LatinLevel *, Mat);
PETSC_INTERN PetscErrorCode LatinNestFinish(Latin);
PETSC_INTERN PetscErrorCode LatinNestReset(Latin);
PETSC_INTERN PetscErrorCode LatinNestDown(Latin);
PETSC_INTERN PetscErrorCode LatinNestUp(Latin);

/* The fixed-point map: z = (sides, nonsmooth links) -> G(z); also sets latin->indicator and leaves U behind */
PETSC_INTERN PetscErrorCode LatinCreateState_Private(Latin, Vec *);
PETSC_INTERN PetscErrorCode LatinInitialState_Private(Latin, Vec);
PETSC_INTERN PetscErrorCode LatinApply_Private(Latin, Vec z, Vec Gz);
PETSC_INTERN PetscErrorCode LatinGatherForces_Private(Latin, const PetscReal z[]);
PETSC_INTERN void           LatinLinkStageGeneral(Latin, const PetscReal state[], PetscReal next[], PetscReal sum[3]);
PETSC_INTERN void           LatinSweepForces(Latin, const PetscReal z[]);
PETSC_INTERN void           LatinSweepStage(Latin, const PetscReal z[], PetscReal next[], PetscReal sum[3]);
PETSC_INTERN PetscErrorCode LatinLocalStage_Private(Latin, const PetscReal z[], PetscReal Gz[]);
PETSC_INTERN PetscErrorCode LatinErrors_Private(Latin, const PetscReal reference[], PetscReal *l2, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinAverage_Private(Latin, Vec u);
PETSC_INTERN PetscErrorCode LatinDistribute_Private(Latin, Vec u, PetscReal copy[]);

/* The linear iteration on the data of the interfaces alone (reflection.c); y in variables whose norm is the energy norm */
PETSC_INTERN PetscErrorCode LatinReflectionApply_Private(Latin, PetscBool loaded, const PetscReal y[], PetscBool symmetric, PetscReal out[]);
PETSC_INTERN PetscErrorCode LatinReflectionSolution_Private(Latin, const PetscReal y[], Vec u);

#endif
