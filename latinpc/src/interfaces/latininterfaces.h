/*
   Interfaces (section 3.1), the micro search directions on them (26), (27), and their macro fields (section 3.2).
*/
#ifndef LATININTERFACES_H
#define LATININTERFACES_H

#include "localsolvers/latinlocalsolvers.h"

/* ---- classes, primal nodes, sides and their mates (interfaces/interface.c) ---- */
/* Frame of an interface. Coordinates are relative to one of its nodes, so that equal shapes give equal bits */
typedef struct {
  PetscReal origin[3], centre[3]; /* [dim] one node; mean of the free nodes, relative to it */
  PetscReal axes[3][3];           /* unit vectors xi, eta, zeta: principal axes, by decreasing extent */
  PetscReal size;
  PetscReal thickness; /* smallest extent over largest */
  PetscBool strong;    /* whether the nodes span dim - 1 directions and so carry the affine fields of section 3.2 */
  PetscBool plane;     /* whether all nodes have the same zeta (in 2D, eta) */
} LatinFrame;

typedef struct {
  PetscInt  sub;                   /* local number of its subdomain */
  PetscInt  neighbour;             /* global number of the subdomain on the other side */
  PetscInt  node_first, node_last; /* its nodes: copies node_list[node_first..node_last) */
  PetscBool strong;
  PetscInt  side_first, side_last; /* its side dofs: [side_first..side_last) */
} LatinInterface;

typedef struct {
  const LatinSubdomains *sub;
  LatinVariant           variant; /* never auto */
  /* made by the set-up */
  PetscInt        count;        /* interface sides on this rank */
  LatinInterface *interface;    /* [count] interface sides, sorted by subdomain, then neighbour */
  PetscInt       *offset;       /* [subdomains + 1] range of the interface sides of each subdomain */
  PetscInt       *node_list;    /* nodes of the interfaces, as copies, interface by interface */
  PetscInt       *share_offset; /* [copies + 1] range of each copy in share_list */
  PetscInt       *share_list;   /* global numbers of the subdomains at the node of each copy, increasing; none at nodes that are not shared or not free */
  PetscInt       *node_class;   /* [copies] class of the node: 0 interior, 1 strong, 2 weak, 3 primal */
  PetscInt       *component;    /* [copies] position of the first subdomain of the copy's primal component among those of the node, -1: not primal */
  PetscInt       *position;     /* [copies] position of the copy's own subdomain among those of the node */
  PetscBool      *glued;        /* [copies] whether the node has a primal component, with this copy or without */
  PetscInt        sides;        /* side dofs on this rank: free dofs of interface sides that carry micro quantities */
  PetscInt       *side_dof;     /* [sides] position of each in arrays over copies */
  PetscBool      *assigned;     /* [sides] whether the node is assigned to this interface: see LatinInterfaceAssign_Private() */
  PetscSF         mate_sf;      /* side dofs -> their mates on the other side of the interface */
  PetscBool       condensed;    /* whether no subdomain of a matrix has interior unknowns, on any rank, as in coarse problems of substructures */
  PetscInt        strong_global, weak_global, side_nodes_global;
  /* tables of m x m integers at nodes of m subdomains: each copy fills its own row, LatinInterfaceExchange_Private() gathers all rows at every copy */
  PetscSF   table_sf;
  PetscInt *table_offset;  /* [copies + 1] start of the table of each copy */
  PetscInt *primal_offset; /* [subdomains + 1] range of the primal dofs of each subdomain */
  PetscInt *primal_dof;    /* position of each primal dof in arrays over copies */
  PetscInt *primal_index;  /* [copies * bs] position among the primal dofs of its subdomain, -1: not primal */
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
/*
   largest ratio, either way, of a scalar direction to the stiffness of an interface; beyond it rounding loses the smaller one, which looks like a
   mechanism
*/
#define LATIN_DIRECTION_RANGE LatinByPrecision(1e10, 1e4)
/* Schur complement of a subdomain, its interior eliminated */
typedef struct {
  PetscInt   n, *row; /* number of rows; [n] these rows, relative to the first one of the subdomain, increasing */
  PetscReal *S;       /* [n][n]; NULL: not stored */
} LatinSchur;

typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  LatinDirectionType     type;  /* type set by the user; LatinDirectionKind() resolves auto */
  PetscReal              value; /* d of a scalar direction, force/length; of the others fraction of the interface stiffness; 0: automatic */
  /* made by the set-up */
  PetscReal *d;            /* [sides] micro search direction, force/length; of a matrix direction its diagonal */
  PetscReal *harmonic;     /* [sides] harmonic mean of the stiffnesses of both subdomains, force/length */
  PetscInt  *matrix_first; /* [interface sides] start in matrix[]; -1: the direction is diagonal */
  /*
     of each matrix direction D, its Cholesky factor L, and L^-1 or the deluxe weights W of LatinDirectionDeluxe(), column-major; equal ones once; NULL:
     none
  */
  PetscReal  *matrix;
  PetscInt    matrices; /* number of interfaces with a matrix direction, over all ranks */
  PetscInt   *like;     /* [subdomains] first subdomain with the same operator and sides; NULL: not compared */
  LatinSchur *schur;    /* [subdomains] Schur complements, kept for the local low-energy fields, which need the same elimination; NULL: none */
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

/* Whether PC latin uses deluxe scaling. It needs variant corner, where a dof is on one interface at most, and the stiffness matrices of both sides */
static inline PetscBool LatinDirectionIsDeluxe(const LatinDirections *dir)
{
  return (PetscBool)(dir->sub->preconditions && dir->inter->variant == LATIN_VARIANT_CORNER && dir->type >= LATIN_DIRECTION_SCHUR);
}

/* Returns the number of interfaces of subdomain s with a matrix direction */
static inline PetscInt LatinDirectionBlocks(const LatinDirections *dir, PetscInt s)
{
  PetscInt n = 0;

  for (PetscInt f = dir->inter->offset[s]; f < dir->inter->offset[s + 1]; f++) n += dir->matrix_first[f] >= 0 ? 1 : 0;
  return n;
}

/* Whether blocks of the operators take the place of Schur complements in deluxe scaling, as no subdomain has an interior */
static inline PetscBool LatinDirectionCondensed(const LatinDirections *dir)
{
  return (PetscBool)(LatinDirectionIsDeluxe(dir) && dir->inter->condensed);
}

/* ---- local low-energy fields (interfaces/spectralmodes.c, interfaces/facemodes.c) ---- */
#define LATIN_SPECTRAL_MOST 64 /* most fields of a subdomain or interface; with 16, KSP latin takes 26 iterations instead of 16 on random coefficient jumps */
/* factor on the threshold in the eigenproblems of interfaces (interfaces/facemodes.c); with 0.1 a second level takes 100 steps, with 0.33 64 */
#define LATIN_SPECTRAL_FACE 0.3
typedef struct {
  const LatinSubdomains *sub;
  const LatinInterfaces *inter;
  const LatinDirections *dir;
  PetscReal              threshold; /* largest eigenvalue lambda of a low-energy mode; 0: no fields, negative: automatic */
  /* made by the set-up */
  PetscInt     *modes;   /* [subdomains] number of low-energy modes */
  PetscInt     *count;   /* [interface sides] number of fields, of both sides together */
  PetscScalar **field;   /* [interface sides] fields, column-major, count columns, rows weighted by sqrt(d) */
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
  PetscInt modes;  /* number of macro modes */
  PetscInt first;  /* start of its rows of R in the macro bases */
  PetscInt number; /* number of the first mode among those of the rank that builds them */
  PetscInt at;     /* position of the first mode among the coarse dofs of its subdomain */
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
  PetscInt        modes_local, modes_global; /* number of modes that this rank builds; of all ranks */
  PetscInt        spectral_global;           /* number of these, of all ranks, from local low-energy fields */
} LatinMacro;
PETSC_INTERN PetscErrorCode LatinMacroSetUp(LatinMacro *);
PETSC_INTERN PetscErrorCode LatinMacroShare_Private(LatinMacro *, const PetscInt pattern[]);
PETSC_INTERN void           LatinMacroMicro(const LatinMacro *, PetscInt f, PetscBool forces, PetscReal x[], PetscReal work[]);
PETSC_INTERN PetscErrorCode LatinMacroReset(LatinMacro *);

/* Returns the row of D R at a side dof of interface f: the forces there of unit macro forces, [modes] */
static inline const PetscReal *LatinMacroDualRow(const LatinMacro *macro, PetscInt f, PetscInt side)
{
  return macro->dual + macro->of[f].first + (side - macro->inter->interface[f].side_first) * macro->of[f].modes;
}

/* ---- equal subdomains (interfaces/repeats.c) ---- */
PETSC_INTERN PetscErrorCode LatinRepeatsOperators_Private(const LatinInterfaces *, PetscInt same[]);
PETSC_INTERN PetscErrorCode LatinRepeatsLike_Private(const LatinInterfaces *, PetscInt same[], PetscInt like[]);
PETSC_INTERN PetscErrorCode LatinRepeats_Private(const LatinInterfaces *, const LatinDirections *, const LatinMacro *, PetscInt pattern[]);

#endif
