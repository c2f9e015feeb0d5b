/*
   Interfaces (section 3.1), the micro search directions on them (26), (27), and their macro fields (section 3.2).
*/
#ifndef LATININTERFACES_H
#define LATININTERFACES_H

#include "localsolvers/latinlocalsolvers.h"

/* ---- classes, primal nodes, sides and their mates (interfaces/interface.c) ---- */
/* The frame of an interface; coordinates are relative to one of its nodes, so that equal shapes give equal bits */
typedef struct {
  PetscReal origin[3], centre[3]; /* one node; the mean of all nodes, relative to it */
  PetscReal axes[3][3];           /* xi, eta, zeta: principal axes, by decreasing extent */
  PetscReal size;
  PetscReal thickness; /* smallest extent over largest extent */
  PetscBool strong;    /* its nodes span dim - 1 directions: they can carry the affine fields of section 3.2 */
  PetscBool plane;     /* all nodes have the same zeta (in 2D, eta) */
} LatinFrame;

typedef struct {
  PetscInt  sub;                   /* subdomain here (local number) */
  PetscInt  neighbour;             /* subdomain on the other side (global number) */
  PetscInt  node_first, node_last; /* copies of its nodes: node_list[node_first..node_last) */
  PetscBool strong;
  PetscInt  side_first, side_last; /* its side dofs */
} LatinInterface;

typedef struct {
  const LatinSubdomains *sub;
  LatinVariant           variant; /* never auto */
  /* made by the set-up */
  PetscInt        count;        /* interface sides here */
  LatinInterface *interface;    /* [count] sorted by subdomain, then neighbour */
  PetscInt       *offset;       /* [subdomains + 1] */
  PetscInt       *node_list;    /* copies of nodes, interface by interface */
  PetscInt       *share_offset; /* [copies + 1] into share_* */
  PetscInt       *share_list;   /* global numbers of the subdomains at the node of each copy, increasing */
  PetscInt       *node_class;   /* [copies] 0 interior, 1 strong, 2 weak, 3 primal */
  PetscInt       *component;    /* [copies] position in share_list of the first subdomain of the copy's primal component, -1 if not primal */
  PetscInt       *position;     /* [copies] position of the copy's own subdomain in share_list */
  PetscBool      *glued;        /* [copies] the node has a primal component, whether it contains this copy or not */
  PetscInt        sides;        /* side dofs here */
  PetscInt       *side_dof;     /* [sides] their dofs in arrays over copies */
  PetscBool      *assigned;     /* [sides] the node is assigned to this interface: see LatinInterfaceAssign_Private() */
  PetscSF         mate_sf;      /* side dof -> its mate on the other side of the interface */
  PetscBool       condensed;    /* no subdomain of a matrix has interior unknowns, on any rank, as in coarse problems of substructures */
  PetscInt        strong_global, weak_global, side_nodes_global;
  /* a table of m x m integers for the m subdomains of a node: each copy fills its own row, LatinInterfaceExchange_Private() gathers all rows at every copy */
  PetscSF   table_sf;
  PetscInt *table_offset;  /* [copies + 1] where the table of each copy starts */
  PetscInt *primal_offset; /* [subdomains + 1] where the primal dofs of each subdomain start */
  PetscInt *primal_dof;    /* their dofs in arrays over copies */
  PetscInt *primal_index;  /* [copies * bs] position in its subdomain's primal list, -1 if not primal */
} LatinInterfaces;
PETSC_INTERN PetscErrorCode LatinInterfaceSetUp(LatinInterfaces *);
PETSC_INTERN PetscErrorCode LatinInterfaceReset(LatinInterfaces *);
PETSC_INTERN PetscErrorCode LatinInterfacePrimal_Private(LatinInterfaces *);
PETSC_INTERN PetscErrorCode LatinInterfaceShares_Private(LatinInterfaces *);
PETSC_INTERN PetscErrorCode LatinInterfaceExchange_Private(const LatinInterfaces *, PetscInt table[]);
PETSC_INTERN PetscErrorCode LatinInterfaceFrame_Private(const LatinSubdomains *, PetscInt n, const PetscInt copies[], LatinFrame *);
PETSC_INTERN PetscErrorCode LatinJumps_Private(const LatinInterfaces *, PetscBool jumps[]);
PETSC_INTERN PetscErrorCode LatinJumpsFaces_Private(const LatinInterfaces *, PetscBool jumps[]);

/* ---- set-up data of the two sides of an interface (interfaces/mates.c) ---- */
PETSC_INTERN PetscErrorCode LatinMateNumbers_Private(const LatinInterfaces *, const PetscInt mine[], PetscInt theirs[]);
PETSC_INTERN PetscErrorCode LatinMateColumns_Private(const LatinInterfaces *, const PetscInt columns[], const PetscReal *const mine[], PetscInt theirs[], size_t first[], PetscReal **mate);

/* ---- search directions (interfaces/searchdirection.c, interfaces/interfacestiffness.c) ---- */
#define LATIN_DIRECTION_RANGE LatinByPrecision(1e10, 1e4) /* largest ratio of a scalar direction to the stiffness of an interface, and of this to that: beyond, one of the two is lost in rounding, which looks like a mechanism */
/* The Schur complement of a subdomain after elimination of its interior */
typedef struct {
  PetscInt   n, *row; /* rows of the subdomain that it keeps, relative to its first one, increasing */
  PetscReal *S;       /* n x n; NULL: not stored */
} LatinSchur;

typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  LatinDirectionType     type;  /* as the user set it; LatinDirectionKind() resolves auto */
  PetscReal              value; /* scalar: d; others: fraction of the interface stiffness; 0: automatic */
  /* made by the set-up */
  PetscReal  *d;            /* [sides] micro search direction, force/length; of a matrix direction its diagonal */
  PetscReal  *harmonic;     /* [sides] harmonic mean of the stiffnesses of both subdomains */
  PetscInt   *matrix_first; /* [interface sides] where the matrix of each starts; -1: the direction is diagonal */
  PetscReal  *matrix;       /* matrix directions: D, its Cholesky factor L, and L^-1 or the deluxe weights W of LatinDirectionDeluxe(), column-major; equal ones are stored once; NULL: none */
  PetscInt    matrices;     /* interfaces with a matrix direction, over all ranks */
  PetscInt   *like;         /* [subdomains] the first one with the same operator and sides; NULL: not compared */
  LatinSchur *schur;        /* [subdomains] kept until the local low-energy fields have used them, which need the same elimination; NULL: none */
} LatinDirections;
PETSC_INTERN LatinDirectionType LatinDirectionKind(const LatinDirections *);
PETSC_INTERN PetscReal          LatinDirectionFraction(const LatinDirections *);
PETSC_INTERN PetscErrorCode     LatinDirectionSetUp(LatinDirections *);
PETSC_INTERN PetscErrorCode     LatinDirectionReset(LatinDirections *);
PETSC_INTERN PetscErrorCode     LatinDirectionApply(const LatinDirections *, PetscInt f, PetscInt n, const PetscReal x[], PetscInt ldx, PetscReal y[], PetscInt ldy);
PETSC_INTERN PetscErrorCode     LatinDirectionEnergy(const LatinDirections *, PetscInt f, PetscInt n, const PetscReal a[], const PetscReal b[], PetscInt ld, PetscReal work[], PetscReal *sum);
PETSC_INTERN PetscErrorCode     LatinDirectionDeluxe(const LatinDirections *, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[]);
PETSC_INTERN PetscErrorCode     LatinDirectionNormalise(const LatinDirections *, PetscInt f, PetscInt modes, PetscReal R[]);
PETSC_INTERN PetscErrorCode     LatinDirectionSprings_Private(const LatinDirections *, PetscReal spring[]);
PETSC_INTERN PetscErrorCode     LatinDirectionMatrix(const LatinDirections *, PetscInt s, const PetscReal spring[], LatinSparse *K);
PETSC_INTERN PetscErrorCode     LatinSchurReset_Private(LatinDirections *);
PETSC_INTERN PetscErrorCode     LatinStiffnessFaces_Private(LatinDirections *, PetscBool blocks, const PetscBool matrices[], size_t first[], PetscReal **S);

/* Does PC latin use deluxe scaling? It requires that a dof is on one interface at most (variant corner), and the stiffness matrices of both sides */
static inline PetscBool LatinDirectionIsDeluxe(const LatinDirections *dir)
{
  return (PetscBool)(dir->sub->preconditions && dir->inter->variant == LATIN_VARIANT_CORNER && dir->type >= LATIN_DIRECTION_SCHUR);
}

/* The number of interfaces of subdomain s with a matrix direction */
static inline PetscInt LatinDirectionBlocks(const LatinDirections *dir, PetscInt s)
{
  PetscInt n = 0;

  for (PetscInt f = dir->inter->offset[s]; f < dir->inter->offset[s + 1]; f++) n += dir->matrix_first[f] >= 0 ? 1 : 0;
  return n;
}

/* Does PC latin use deluxe scaling where no subdomain has an interior, so that the blocks of its operator take the place of Schur complements? */
static inline PetscBool LatinDirectionCondensed(const LatinDirections *dir)
{
  return (PetscBool)(LatinDirectionIsDeluxe(dir) && dir->inter->condensed);
}

/* ---- local low-energy fields (interfaces/spectralmodes.c, interfaces/facemodes.c) ---- */
#define LATIN_SPECTRAL_MOST 64  /* most fields of a subdomain; 8 take as many iterations as a threshold a tenth as large */
#define LATIN_SPECTRAL_FACE 0.3 /* factor of the threshold in the eigenproblems of interfaces (interfaces/facemodes.c) */
typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinDirections *dir;
  PetscReal              threshold; /* of the eigenvalues; 0: no fields, negative: automatic */
  /* made by the set-up */
  PetscInt     *modes;   /* [subdomains] low-energy modes found */
  PetscInt     *count;   /* [interface sides] fields of both sides */
  PetscScalar **field;   /* [interface sides] column-major, count columns, rows weighted by sqrt(d) */
  PetscReal   **inverse; /* [subdomains] dense inverse of K_E, until the linear stage takes it as local solver; NULL: none */
} LatinSpectral;
PETSC_INTERN PetscErrorCode LatinSpectralSetUp(LatinSpectral *);
PETSC_INTERN PetscErrorCode LatinSpectralExtend(const LatinSpectral *, PetscInt f, PetscInt rows, PetscInt *fields, PetscScalar F[]);
PETSC_INTERN PetscErrorCode LatinSpectralStatistics_Private(const LatinSpectral *, PetscInt *subdomains, PetscInt *most);
PETSC_INTERN PetscReal      LatinSpectralThreshold(const LatinSpectral *);
PETSC_INTERN PetscErrorCode LatinSpectralEigen_Private(PetscInt n, PetscReal least, PetscScalar A[], PetscScalar Q[], PetscScalar V[], PetscInt *first, PetscInt *modes, PetscBool *bad);
PETSC_INTERN PetscErrorCode LatinSpectralFaces_Private(LatinSpectral *, const PetscBool held[], PetscReal threshold, PetscBool *bad);
PETSC_INTERN PetscErrorCode LatinSpectralFreeInverses(LatinSpectral *);
PETSC_INTERN PetscErrorCode LatinSpectralReset(LatinSpectral *);

/* ---- macro bases (interfaces/macrobasis.c) ---- */
typedef struct {
  PetscInt modes;  /* macro modes kept */
  PetscInt first;  /* where its rows of R start in the macro bases */
  PetscInt number; /* number of the first one among the modes of the rank that builds them */
  PetscInt at;     /* position of the first one among the coarse dofs of its subdomain */
} LatinFaceModes;

typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinDirections *dir;
  const LatinSpectral   *spectral;
  LatinModesType         type;
  /* made by the set-up */
  LatinFaceModes *of;                        /* [interface sides] */
  PetscReal      *basis;                     /* R of each interface, [side dofs of the interface][modes], with R^t D R = 1 */
  PetscReal      *dual;                      /* D R, in the same places */
  PetscInt        modes_local, modes_global; /* modes that this rank builds; of all ranks */
  PetscInt        spectral_global;           /* those of all ranks that come from local low-energy fields */
} LatinMacro;
PETSC_INTERN PetscErrorCode LatinMacroSetUp(LatinMacro *);
PETSC_INTERN PetscErrorCode LatinMacroShare_Private(LatinMacro *, const PetscInt pattern[]);
PETSC_INTERN void           LatinMacroMicro(const LatinMacro *, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[]);
PETSC_INTERN PetscErrorCode LatinMacroReset(LatinMacro *);

/* The row of D R at a side dof of interface f: the forces there of unit macro forces */
static inline const PetscReal *LatinMacroDualRow(const LatinMacro *macro, PetscInt f, PetscInt side)
{
  return macro->dual + macro->of[f].first + (side - macro->inter->interface[f].side_first) * macro->of[f].modes;
}

/* Which subdomains are equal (interfaces/repeats.c) */
PETSC_INTERN PetscErrorCode LatinRepeatsOperators_Private(const LatinInterfaces *, PetscInt same[]);
PETSC_INTERN PetscErrorCode LatinRepeatsLike_Private(const LatinInterfaces *, PetscInt same[], PetscInt like[]);
PETSC_INTERN PetscErrorCode LatinRepeats_Private(const LatinInterfaces *, const LatinDirections *, const LatinMacro *, PetscInt pattern[]);

#endif
