/*
   The public C interface of liblatinpc: the scalable multiscale LATIN domain decomposition method as PETSc solver types.

   Equation numbers are those of P. Alart, D. Dureisseix, "A scalable multiscale LATIN method adapted
   to nonsmooth discrete media", Comput. Methods Appl. Mech. Engrg. 197 (2008) 319-331.
*/
#ifndef LATINPC_H
#define LATINPC_H

#include <petscts.h>

#define LATINPC_VERSION_MAJOR    0
#define LATINPC_VERSION_MINOR    1
#define LATINPC_VERSION_SUBMINOR 0

/* Names of the solver types */
#define SNESLATIN "latin"
#define KSPLATIN  "latin"
#define PCLATIN   "latin"
#define TSLATIN   "latin"

/* Constitutive laws of a link: tension tau as a function of the strain e + e0; their table is in structure/laws.c */
typedef enum {
  LATIN_LAW_BAR,              /* tau = k (e + e0)              (2)      */
  LATIN_LAW_CABLE,            /* tau = k max(e + e0, 0)        (4), (5) */
  LATIN_LAW_COMPRESSION_ONLY, /* tau = k min(e + e0, 0), the mirror image of a cable; an elastic contact with gap e0 */
  LATIN_LAW_INEXTENSIBLE,     /* 0 <= -(e + e0), tau >= 0, one of them zero (3) */
  LATIN_LAW_CONTACT,          /* 0 <= e + e0, tau <= 0, one of them zero: rigid contact with gap e0 */
  LATIN_LAW_FRICTION,         /* normal part of a rigid contact with Coulomb friction, followed by dim - 1 tangential parts */
  LATIN_LAW_TANGENT           /* tangential part of that contact: |tau_t| <= mu |tau_n|, against the slip */
} LatinLawType;
PETSC_EXTERN const char *const LatinLawTypes[];

/* An elastic law of the user: k is the stiffness of the link, x = e + e0 */
typedef struct {
  PetscReal (*tension)(PetscReal k, PetscReal x, void *ctx);             /* tau, not decreasing with x */
  PetscReal (*tangent)(PetscReal k, PetscReal x, void *ctx);             /* an element of the generalised derivative */
  PetscReal (*energy)(PetscReal k, PetscReal x, void *ctx);              /* the potential whose derivative is the tension */
  PetscReal (*local)(PetscReal k, PetscReal e0, PetscReal y, void *ctx); /* tau - k e at the e with tau + k e = y; NULL: by Newton's method */
  void *ctx;
} LatinLawFunctions;

/* Dofs of weak interfaces in the coarse problem, section 4 of the article */
typedef enum {
  LATIN_VARIANT_NONE,      /* 4.1: micro quantities only               */
  LATIN_VARIANT_MACRO,     /* 4.2: the whole displacement is macro     */
  LATIN_VARIANT_CORNER,    /* 4.4: one displacement per node, section 5 */
  LATIN_VARIANT_PUBLISHED, /* the same with the micro springs of (28) on corners, as in the article */
  LATIN_VARIANT_PRIMAL,    /* one displacement per node of every interface: no micro quantities but those of links */
  LATIN_VARIANT_AUTO       /* primal, or corner if most subdomains repeat others */
} LatinVariant;
PETSC_EXTERN const char *const LatinVariants[];

/* Macro fields of a strong interface, section 3.2 */
typedef enum {
  LATIN_MODES_AFFINE, /* translations, rotations, stretchings and shearing */
  LATIN_MODES_RIGID   /* translations and rotations */
} LatinModesType;
PETSC_EXTERN const char *const LatinModesTypes[];

/* Partitioner, unless the caller sets a partition */
typedef enum {
  LATIN_PARTITIONER_AUTO,    /* METIS; parallel if the structure is too large for one of several ranks */
  LATIN_PARTITIONER_METIS,   /* METIS on one rank */
  LATIN_PARTITIONER_PARALLEL /* PT-Scotch or ParMETIS on all ranks */
} LatinPartitioner;
PETSC_EXTERN const char *const LatinPartitioners[];

/* Micro search direction d of the interfaces */
typedef enum {
  LATIN_DIRECTION_SCALAR,   /* a number for each interface */
  LATIN_DIRECTION_DIAGONAL, /* a number for each degree of freedom of an interface */
  LATIN_DIRECTION_BLOCK,    /* a matrix for each interface: stiffness of its links */
  LATIN_DIRECTION_SCHUR,    /* a matrix for each interface: Schur complements of its subdomains */
  LATIN_DIRECTION_AUTO      /* of a matrix: diagonal, schur where coefficients jump; of links: schur */
} LatinDirectionType;
PETSC_EXTERN const char *const LatinDirectionTypes[];

/* Precision of factors of the linear stage, whose rounding errors each stage corrects */
typedef enum {
  LATIN_PRECISION_DOUBLE,
  LATIN_PRECISION_SINGLE, /* if accurate enough */
  LATIN_PRECISION_AUTO    /* single for large factors, if accurate enough */
} LatinPrecision;
PETSC_EXTERN const char *const LatinPrecisions[];

/* Convergence criterion of SNES latin */
typedef enum {
  LATIN_STOP_INDICATOR, /* relative distance of the two stages, against -snes_stol */
  LATIN_STOP_RESIDUAL,  /* norm of the nodal unbalance (1), against -snes_rtol and -snes_atol */
  LATIN_STOP_REFERENCE, /* l2 error relative to a given reference, against -snes_stol */
  LATIN_STOP_ERROR,     /* estimated relative error of the displacements of all subdomains, against -snes_latin_error */
  LATIN_STOP_ENERGY,    /* the same in the energy norm of the links, all counted as taut */
  LATIN_STOP_AUTO       /* error; indicator with -snes_stol, for bars alone in one coarse problem, for rigid links in single precision */
} LatinStopType;
PETSC_EXTERN const char *const LatinStopTypes[];

/* Rotations of the links of a structure */
typedef enum {
  LATIN_GEOMETRY_LINEAR,    /* none: equilibrium in the drawn configuration */
  LATIN_GEOMETRY_PRESTRESS, /* small: geometric stiffness of the prestress in the drawn configuration */
  LATIN_GEOMETRY_LARGE      /* large: equilibrium in the displaced configuration */
} LatinGeometry;
PETSC_EXTERN const char *const LatinGeometries[];

/* Initial state of a solve of SNES latin after a converged one */
typedef enum {
  LATIN_WARM_START_NONE,       /* from the displacements in the solution vector */
  LATIN_WARM_START_LAST,       /* the state of the last solve */
  LATIN_WARM_START_EXTRAPOLATE /* extrapolated from the states of the last two */
} LatinWarmStart;
PETSC_EXTERN const char *const LatinWarmStarts[];

/* Switch from the iteration of SNES latin to Newton's method */
typedef enum {
  LATIN_NEWTON_AUTO, /* if the iteration stagnates, diverges or ends in rounding, and to prove an error */
  LATIN_NEWTON_NEVER
} LatinNewtonType;
PETSC_EXTERN const char *const LatinNewtonTypes[];

/* A structure: nodes joined by links, with laws, supports and loads (section 2.1) */
typedef struct _p_LatinStructure *LatinStructure;
/* The method: subdomains, interfaces, operators of the two stages (sections 3 to 5) */
typedef struct _p_Latin *Latin;

/* Sizes of the decomposition, as in Table 3, over all ranks */
typedef struct {
  PetscInt  subdomains;
  PetscInt  strong_interfaces;
  PetscInt  weak_interfaces;
  PetscInt  strong_macro_dofs;                            /* coarse unknowns of strong interfaces */
  PetscInt  weak_dofs;                                    /* coarse unknowns of weak interfaces or corners */
  PetscInt  coarse_size, coarse_levels;                   /* rows of the coarse KSP's matrix; levels of groups condensed before */
  PetscInt  local_macro_dofs;                             /* those of strong_macro_dofs that are local low-energy fields */
  PetscInt  low_energy_subdomains, local_modes_max;       /* subdomains with such fields; most fields of one subdomain */
  PetscInt  micro_sides;                                  /* nodes, summed over interface sides, with micro quantities */
  PetscInt  state_size;                                   /* length of the fixed-point unknown */
  PetscReal direction_min, direction_mean, direction_max; /* search direction d, force/length */
} LatinStatistics;

/* Cost of a decomposition */
typedef struct {
  const char *choice;                          /* how the number of subdomains was chosen; borrowed */
  PetscReal   factor_operations, factor_bytes; /* of the factors of the subdomains; 0: unknown for this local solver */
  PetscReal   setup_seconds;                   /* time of the last set-up */
  PetscInt    linear_stages;                   /* number since the set-up */
  PetscReal   stage_seconds;                   /* mean time of a linear stage */
} LatinCost;

/* Function that may end a solve by the error it returns */
typedef PetscErrorCode LatinInterruptFn(void);

PETSC_EXTERN PetscErrorCode LatinInitializePackage(void);
PETSC_EXTERN PetscErrorCode LatinSetInterrupt(LatinInterruptFn *check);

/* ---- laws ---- */
PETSC_EXTERN PetscErrorCode LatinLawRegister(const char name[], const LatinLawFunctions *, PetscInt *law);
PETSC_EXTERN PetscErrorCode LatinLawRegisterTable(const char name[], PetscInt n, const PetscReal elongation[], const PetscReal tension[], PetscInt *law);
PETSC_EXTERN PetscErrorCode LatinLawGetName(PetscInt law, const char *name[]);
PETSC_EXTERN PetscErrorCode LatinLawGetStiffness(PetscInt law, PetscReal *stiffness);
PETSC_EXTERN PetscErrorCode LatinLawGetTension(PetscInt law, PetscReal stiffness, PetscReal strain, PetscReal *tension);

/* ---- structures ---- */
PETSC_EXTERN PetscErrorCode LatinStructureCreate(MPI_Comm, PetscInt dim, PetscInt nodes_local, PetscInt nodes_global, const PetscReal coordinates[], PetscInt links_local, const PetscInt link_nodes[], LatinStructure *);
PETSC_EXTERN PetscErrorCode LatinStructureSetLaws(LatinStructure, const PetscInt law[], const PetscReal stiffness[], const PetscReal e0[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetLaws(LatinStructure, PetscInt *, const PetscInt *law[], const PetscReal *stiffness[], const PetscReal *e0[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetDirections(LatinStructure, const PetscReal direction[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetDirections(LatinStructure, PetscInt *, const PetscReal *direction[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetFriction(LatinStructure, const PetscReal coefficient[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetFriction(LatinStructure, PetscInt *, const PetscReal *coefficient[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetSupports(LatinStructure, const PetscBool fixed[], const PetscReal prescribed[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetSupports(LatinStructure, PetscInt *, const PetscBool *fixed[], const PetscReal *prescribed[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetPrescribed(LatinStructure, const PetscReal prescribed[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetLoads(LatinStructure, const PetscReal force[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetLoads(LatinStructure, PetscInt *, const PetscReal *force[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetMass(LatinStructure, const PetscReal mass[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetMass(LatinStructure, PetscInt *, const PetscReal *mass[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetInitialElongations(LatinStructure, const PetscReal e0[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetPrestress(LatinStructure, const PetscReal prestress[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetGeometry(LatinStructure, LatinGeometry);
PETSC_EXTERN PetscErrorCode LatinStructureGetGeometry(LatinStructure, LatinGeometry *);
PETSC_EXTERN PetscErrorCode LatinStructureSetUp(LatinStructure);
PETSC_EXTERN PetscErrorCode LatinStructureGetDM(LatinStructure, DM *);
PETSC_EXTERN PetscErrorCode LatinStructureAttachSNES(LatinStructure, SNES);
PETSC_EXTERN PetscErrorCode LatinStructureAttachTS(LatinStructure, TS);
PETSC_EXTERN PetscErrorCode LatinStructureGetSizes(LatinStructure, PetscInt *dim, PetscInt *nodes, PetscInt *links, PetscInt *free_dofs);
PETSC_EXTERN PetscErrorCode LatinStructureComputeResidual(LatinStructure, Vec u, Vec r);
PETSC_EXTERN PetscErrorCode LatinStructureComputeJacobian(LatinStructure, Vec u, Mat J);
PETSC_EXTERN PetscErrorCode LatinStructureComputeGeometricStiffness(LatinStructure, Vec u, const PetscReal tension[], Mat G);
PETSC_EXTERN PetscErrorCode LatinStructureComputeEnergy(LatinStructure, Vec u, PetscReal *energy);
PETSC_EXTERN PetscErrorCode LatinStructureComputeKineticEnergy(LatinStructure, Vec v, PetscReal *energy);
PETSC_EXTERN PetscErrorCode LatinStructureComputeErrors(LatinStructure, Vec u, Vec reference, PetscReal *l2, PetscReal *energy);
PETSC_EXTERN PetscErrorCode LatinStructureGetDisplacements(LatinStructure, Vec u, PetscReal displacement[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetTensions(LatinStructure, Vec u, PetscReal tension[]);
PETSC_EXTERN PetscErrorCode LatinStructureGetTensionRates(LatinStructure, Vec u, Vec v, PetscReal rate[]);
PETSC_EXTERN PetscErrorCode LatinStructureSetDisplacements(LatinStructure, const PetscReal displacement[], Vec u);
PETSC_EXTERN PetscErrorCode LatinStructureDestroy(LatinStructure *);

/* ---- solvers ---- */
PETSC_EXTERN PetscErrorCode SNESLatinGetLatin(SNES, Latin *);
PETSC_EXTERN PetscErrorCode SNESLatinSetStop(SNES, LatinStopType);
PETSC_EXTERN PetscErrorCode SNESLatinGetStop(SNES, LatinStopType *);
PETSC_EXTERN PetscErrorCode SNESLatinSetError(SNES, PetscReal error);
PETSC_EXTERN PetscErrorCode SNESLatinGetError(SNES, PetscReal *error);
PETSC_EXTERN PetscErrorCode SNESLatinSetTensionError(SNES, PetscReal error);
PETSC_EXTERN PetscErrorCode SNESLatinGetTensionError(SNES, PetscReal *error);
PETSC_EXTERN PetscErrorCode SNESLatinSetBalance(SNES, PetscReal balance);
PETSC_EXTERN PetscErrorCode SNESLatinGetBalance(SNES, PetscReal *balance);
PETSC_EXTERN PetscErrorCode SNESLatinSetLargestUnbalance(SNES, PetscReal force);
PETSC_EXTERN PetscErrorCode SNESLatinGetLargestUnbalance(SNES, PetscReal *force);
PETSC_EXTERN PetscErrorCode SNESLatinSetNewton(SNES, LatinNewtonType);
PETSC_EXTERN PetscErrorCode SNESLatinGetNewton(SNES, LatinNewtonType *);
PETSC_EXTERN PetscErrorCode SNESLatinSetReference(SNES, Vec);
PETSC_EXTERN PetscErrorCode SNESLatinGetReference(SNES, Vec *);
PETSC_EXTERN PetscErrorCode SNESLatinSetWarmStart(SNES, LatinWarmStart);
PETSC_EXTERN PetscErrorCode SNESLatinGetWarmStart(SNES, LatinWarmStart *);
PETSC_EXTERN PetscErrorCode SNESLatinSolveCases(SNES, PetscInt n, const PetscReal *const load[], const PetscReal *const prescribed[], const PetscReal *const e0[], PetscReal *const displacement[], PetscReal *const tension[], PetscInt stages[]);
PETSC_EXTERN PetscErrorCode SNESLatinGetHistory(SNES, PetscInt *, const PetscReal *indicator[], const PetscReal *error_l2[], const PetscReal *error_energy[]);
PETSC_EXTERN PetscErrorCode SNESLatinGetEstimates(SNES, PetscInt *, const PetscReal *estimate[], PetscReal *last, PetscReal *floor);
PETSC_EXTERN PetscErrorCode SNESLatinGetTensionEstimate(SNES, PetscReal *error);
PETSC_EXTERN PetscErrorCode SNESLatinGetPath(SNES, PetscInt *renewals, PetscReal *borne);
PETSC_EXTERN PetscErrorCode SNESLatinGetBranch(SNES, PetscBool *begins);
PETSC_EXTERN PetscErrorCode SNESLatinGetUnsupportedNodes(SNES, PetscInt *count, PetscInt *listed, const PetscInt *node[], PetscReal *distance);
PETSC_EXTERN PetscErrorCode SNESLatinGetJammedLinks(SNES, PetscInt *count, PetscInt *listed, const PetscInt *link[]);
PETSC_EXTERN PetscErrorCode SNESLatinGetTensions(SNES, PetscReal tension[]);
PETSC_EXTERN PetscErrorCode SNESLatinGetOuter(SNES, SNES *);
PETSC_EXTERN PetscErrorCode LatinStateSave(PetscObject solver, Vec u, const char file[], PetscInt n, const char note[]);
PETSC_EXTERN PetscErrorCode LatinStateLoad(PetscObject solver, Vec u, const char file[], PetscInt *n, char *note[]);
PETSC_EXTERN PetscErrorCode LatinGetEnergyBound(SNES, PetscReal *bound, PetscReal *relative);
PETSC_EXTERN PetscErrorCode LatinGetDigits(SNES, PetscReal *unbalance, PetscReal *rounding, PetscReal *places, PetscReal *values);
PETSC_EXTERN PetscErrorCode KSPLatinGetLatin(KSP, Latin *);
PETSC_EXTERN PetscErrorCode LatinStructureAttachKSP(LatinStructure, KSP);
PETSC_EXTERN PetscErrorCode KSPLatinGetOuter(KSP, KSP *);
PETSC_EXTERN PetscErrorCode TSLatinGetTensions(TS, PetscReal tension[]);
PETSC_EXTERN PetscErrorCode TSLatinGetCause(TS, size_t room, char cause[]);
PETSC_EXTERN PetscErrorCode PCLatinGetLatin(PC, Latin *);
PETSC_EXTERN PetscErrorCode LatinStructureAttachPC(LatinStructure, PC);
PETSC_EXTERN PetscErrorCode PCShellSetLatin(PC);

PETSC_EXTERN PetscErrorCode LatinSetSubdomains(Latin, PetscInt);
PETSC_EXTERN PetscErrorCode LatinSetPartition(Latin, PetscInt links, const PetscInt subdomain[]);
PETSC_EXTERN PetscErrorCode LatinGetPartition(Latin, PetscInt *links, const PetscInt *subdomain[]);
PETSC_EXTERN PetscErrorCode LatinSetPartitioner(Latin, LatinPartitioner);
PETSC_EXTERN PetscErrorCode LatinGetPartitioner(Latin, LatinPartitioner *);
PETSC_EXTERN PetscErrorCode LatinSetVariant(Latin, LatinVariant);
PETSC_EXTERN PetscErrorCode LatinGetVariant(Latin, LatinVariant *);
PETSC_EXTERN PetscErrorCode LatinSetModes(Latin, LatinModesType, PetscReal threshold);
PETSC_EXTERN PetscErrorCode LatinGetModes(Latin, LatinModesType *, PetscReal *threshold);
PETSC_EXTERN PetscErrorCode LatinSetDirection(Latin, LatinDirectionType, PetscReal value);
PETSC_EXTERN PetscErrorCode LatinGetDirection(Latin, LatinDirectionType *, PetscReal *value);
PETSC_EXTERN PetscErrorCode LatinSetPrecision(Latin, LatinPrecision);
PETSC_EXTERN PetscErrorCode LatinGetPrecision(Latin, LatinPrecision *);
PETSC_EXTERN PetscErrorCode LatinGetLocalKSP(Latin, PetscInt i, KSP *);
PETSC_EXTERN PetscErrorCode LatinGetCoarseKSP(Latin, KSP *);
PETSC_EXTERN PetscErrorCode LatinGetStatisticsOfSize(Latin, size_t, LatinStatistics *);
PETSC_EXTERN PetscErrorCode LatinGetCost(Latin, LatinCost *);
#define LatinGetStatistics(latin, statistics) LatinGetStatisticsOfSize(latin, sizeof(*(statistics)), statistics)
PETSC_EXTERN PetscErrorCode LatinGetSubdomains(Latin, PetscInt *n_local, PetscInt *first);
PETSC_EXTERN PetscErrorCode LatinGetSubdomainIS(Latin, PetscInt i, IS *);
PETSC_EXTERN PetscErrorCode LatinGetSubdomainOfLinks(Latin, PetscInt subdomain[]);
PETSC_EXTERN PetscErrorCode LatinGetNodeClasses(Latin, PetscInt node_class[]);
PETSC_EXTERN PetscErrorCode LatinGetMacroStiffness(Latin, PetscInt i, Mat *);

#endif
