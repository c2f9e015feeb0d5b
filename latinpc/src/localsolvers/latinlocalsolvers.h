/*
   Solvers of the subdomains: batches that share a factor, factorisations and their diagnosis, solvers by options, Schur
   complements on interfaces.
*/
#ifndef LATINLOCALSOLVERS_H
#define LATINLOCALSOLVERS_H

#include "subdomains/latinsubdomains.h"

/* ---- direct solvers (localsolvers/factor.c) ---- */
#define LATIN_MECHANISM LatinByPrecision(1e-14, 5e-6) /* stiffness of a displacement, relative to the diagonal, below which it is rounding alone: 45 eps */

/*
   largest accepted contraction of the error, in energy, by a solve with a factor in single precision; that of the worst displacement is some ten times
   the measured one
*/
#define LATIN_ROUNDED_CONTRACTION 0.01

/* Precision of a factor, requested or in use; higher ones first */
typedef enum {
  LATIN_DOUBLE,  /* double: arithmetic and factor */
  LATIN_ROUNDED, /* arithmetic in double, factor rounded to single precision */
  LATIN_SINGLE,  /* single: arithmetic and factor */
  LATIN_BY_SIZE  /* request: the fastest of these */
} LatinArithmetic;

/* Result of a factorisation on this rank */
typedef struct {
  PetscErrorCode ierr;
  PCFailedReason failed;
  PetscBool      mechanism;
  PetscReal      rounding;    /* contraction of the error by a solve, in the energy norm, PETSC_SMALL if not measured; 0: in double precision */
  PetscReal      softest;     /* Rayleigh quotient of the softest displacement relative to the diagonal; 0: not computed */
  Vec            mode;        /* displacement of zero energy of a mechanism, or NULL */
  PetscBool      provisional; /* input: linear stages will test the factor, and A may change before: no search for mechanisms, no mode */
  PetscBool      tried;       /* input: the matrix may not be positive definite, which is no error: no mode */
  PetscBool      staged;      /* input: linear stages will test the precision of a factor with Schur complement */
} LatinFactorStatus;
PETSC_INTERN PetscErrorCode LatinDirectSolver_Private(PC, Mat, MatSolverType preferred);
PETSC_INTERN PetscErrorCode LatinDirectLU_Private(PC, Mat);
PETSC_INTERN PetscErrorCode LatinFactorTry_Private(KSP, Mat, LatinFactorStatus *);
PETSC_INTERN PetscErrorCode LatinFactor_Private(KSP, Mat, IS kept, Vec whole, const LatinArithmetic *larger, LatinFactorStatus *);
PETSC_INTERN PetscErrorCode LatinFactorRefine_Private(KSP, Mat, IS kept, LatinArithmetic, LatinFactorStatus *);
PETSC_INTERN PetscErrorCode LatinDenseCreate_Private(PetscInt, PetscInt, Mat *);
PETSC_INTERN PetscErrorCode LatinDenseSolve_Private(KSP, Mat B, Mat X, KSPConvergedReason *failed);
static inline PetscBool     LatinFactorFailed(const LatinFactorStatus *status)
{
  return (PetscBool)(status->ierr || status->failed || status->mechanism);
}

/* ---- the Mat of a factor of ours (localsolvers/factorshell.c) ---- */
PETSC_INTERN PetscErrorCode LatinFactorShell_Private(MPI_Comm, PetscInt n, MatSolverType, void *data, Mat *F);

/* ---- the order of elimination (localsolvers/ordering.c) ---- */
#define LATIN_ORDERING "latin"       /* a MatOrderingType */
#define LATIN_PLACES   "LatinPlaces" /* name of the coordinates of nodes composed on a matrix, a Vec whose block size is the dimension */
PETSC_INTERN PetscErrorCode LatinOrdering(Mat, MatOrderingType, IS *rows, IS *columns);
PETSC_INTERN PetscErrorCode LatinOrderingNodes_Private(PetscInt bs, PetscInt n, const PetscInt ia[], const PetscInt ja[], PetscInt first[], PetscInt **list);
PETSC_INTERN PetscErrorCode LatinOrderNodes_Private(Mat, PetscInt rows, const PetscInt ia[], const PetscInt ja[], const PetscBool kept[], PetscInt order[]);

/* ---- Cholesky with the interfaces last (localsolvers/cholesky.c) ---- */
#define LATIN_CHOLESKY    "latin"      /* a MatSolverType */
#define LATIN_ORDER       "LatinOrder" /* name of the order of elimination composed on a matrix, an IS */
#define LATIN_FRONT_LANES 16           /* interleaved right-hand sides: in single precision they fill a vector register of 512 bits */
/* Callback of the owner of the entries of a matrix, which the last fronts do not read: releases them, or (again) restores them */
typedef struct {
  PetscErrorCode (*call)(void *owner, PetscBool again); /* NULL: the entries are kept */
  void *owner;
} LatinEntriesCallback;
PETSC_INTERN PetscErrorCode LatinCholeskyRegister(void);
PETSC_INTERN PetscErrorCode LatinCholeskyRound(PC, LatinArithmetic);
PETSC_INTERN PetscErrorCode LatinCholeskyPrecision(PC, LatinArithmetic *);
PETSC_INTERN PetscErrorCode LatinCholeskyEnergy(PC, Vec b, PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinCholeskyCost(PC, PetscReal *operations, PetscReal *bytes);
PETSC_INTERN PetscErrorCode LatinCholeskyAgain(PC, Mat, LatinArithmetic);
PETSC_INTERN PetscErrorCode LatinCholeskySetLower(Mat);
PETSC_INTERN PetscErrorCode LatinCholeskySetCallback(Mat, LatinEntriesCallback);
PETSC_INTERN PetscErrorCode LatinCholeskyTakeSchur(Mat, PetscReal **S);
PETSC_INTERN PetscErrorCode LatinCholeskyTakeLower(Mat, PetscReal **S);
PETSC_INTERN PetscErrorCode LatinCholeskyOrder(Mat, const PetscInt *order[]);
PETSC_INTERN PetscErrorCode LatinCholeskySolveSome(Mat, PetscInt rows, const PetscInt row[], PetscInt columns, PetscReal b[]);
PETSC_INTERN PetscErrorCode LatinCholeskySolveLanes(Mat, float x[], PetscReal energy[], PetscReal square[]);
PETSC_INTERN PetscErrorCode LatinCholeskyForward(Mat, PetscReal g[], PetscReal *energy);
PETSC_INTERN PetscErrorCode LatinCholeskyBackward(Mat, PetscReal g[], PetscReal *energy);

/* ---- one dense Schur complement (localsolvers/elimination.c) ---- */
PETSC_INTERN PetscErrorCode LatinEliminate_Private(const LatinSparse *, PetscInt gamma, const PetscInt kept[], PetscReal F[], PetscBool *bad);

/* ---- solvers chosen by options (localsolvers/chosen.c) ---- */
/* relative tolerance of an iterative solver in place of a direct one; with 1e-8 some structures take twice as many iterations */
#define LATIN_INEXACT_RTOL LatinByPrecision(1e-10, 1e-5)
PETSC_INTERN PetscErrorCode LatinSolverIsDefault_Private(PetscObject parent, const char name[], PetscBool *is);
PETSC_INTERN PetscErrorCode LatinSolverCreate_Private(MPI_Comm, PetscObject parent, const char name[], KSP *);
PETSC_INTERN PetscErrorCode LatinSolverDirect_Private(KSP, PetscBool *);
PETSC_INTERN PetscErrorCode LatinSolverNote_Private(KSP, PetscBool preconditions, PetscBool *failed);
PETSC_INTERN PetscErrorCode LatinSolverDefaults_Private(KSP, PetscBool once);
PETSC_INTERN PetscErrorCode LatinSolverAccurate_Private(KSP, PetscBool direct, KSP *);

/* ---- batches of subdomains and their solvers (localsolvers/batches.c) ---- */
#define LATIN_BATCH_COLUMNS 64 /* equal subdomains solved together: right-hand sides stay in cache */

/* Subdomains with bitwise equal operators */
typedef struct {
  PetscInt members, *sub; /* number of subdomains; [members] these, of which the first one represents all */
  PetscInt rows;          /* rows of the operator */
} LatinBatch;

typedef struct {
  PetscInt    n;
  LatinBatch *batch;
  PetscInt   *pattern; /* [subdomains] subdomain that represents each */
} LatinBatches;
PETSC_INTERN PetscErrorCode LatinBatchesSetUp(const LatinSubdomains *, PetscInt pattern[], LatinBatches *);
PETSC_INTERN PetscErrorCode LatinBatchesReset(LatinBatches *);
PETSC_INTERN PetscInt       LatinBatchRun(const LatinBatch *, PetscInt m);

/* Matrix and KSP of a batch of the last set-up, whose symbolic factorisation serves a matrix of the same pattern again */
typedef struct {
  LatinSparse rows; /* arrays of K */
  Mat         K;
  KSP         ksp;
  IS          kept;
} LatinRetired;

/* Solvers of the subdomains: a matrix and a KSP for each batch */
typedef struct LatinLocalSolvers {
  const LatinSubdomains *sub;
  const LatinBatches    *batches;
  PetscInt               n;
  PetscBool              direct; /* whether all are factorisations */
  LatinSparse           *rows;   /* [n] rows of the operators, filled by others */
  /* [subdomains + 1] range in kept[]; kept[]: entries on the copies that are rows of the Schur complements; NULL: none */
  const PetscInt *kept_offset, *kept;
  /* [batches] whether the factor has a Schur complement; NULL: all have, of all interface dofs, and linear stages test their precision */
  const PetscBool                *keeps;
  const struct LatinLocalSolvers *like;      /* solvers of the same rows without the clamped ones, whose order of elimination is reused; NULL: none */
  LatinPrecision                  precision; /* allowed precision of factors, whose rounding errors linear stages correct */
  LatinEntriesCallback            callback;  /* callback that releases the entries of the only operator */
  PetscReal                       rounding;  /* largest contraction of the error by the factors of this rank; 0: in double precision */
  Mat                            *K, *B, *X; /* [n] operators; right-hand sides and solutions of some members, dense */
  KSP                            *ksp;
  IS                             *rest; /* [n] rows of the Schur complement, ordered last; NULL: none */
  PetscInt                        retired;
  LatinRetired                   *before; /* [retired] solvers of the last set-up, until this one has reused them */
  LatinFactorStatus               status; /* result of the set-up on this rank */
  PetscInt                        last;   /* last batch that was set up: the one that failed, if any did */
  PetscBool                       failed; /* whether a solve on this rank has failed since the caller cleared it */
} LatinLocalSolvers;
PETSC_INTERN PetscErrorCode LatinLocalSolversCreate(const LatinSubdomains *, const LatinBatches *, LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversSetUp(LatinLocalSolvers *, const char name[], PetscBool once);
PETSC_INTERN PetscErrorCode LatinLocalSolversRefine(LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversDestroy(LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversRetire(LatinLocalSolvers *);
PETSC_INTERN PetscErrorCode LatinLocalSolversRenew_Private(LatinLocalSolvers *, PetscInt batch, const PetscReal spring[], const PetscBool held[], PetscBool *done);
PETSC_INTERN PetscErrorCode LatinLocalSolversRecall_Private(LatinLocalSolvers *, PetscInt batch, PetscBool *found);
PETSC_INTERN PetscErrorCode LatinSameRows_Private(Mat, PetscInt rows, const PetscInt i[], const PetscInt j[], PetscBool *same);
PETSC_INTERN PetscErrorCode LatinLocalSolve_Private(LatinLocalSolvers *, PetscInt batch, const PetscReal g[], PetscReal U[]);
PETSC_INTERN PetscErrorCode LatinLocalSolveAll(LatinLocalSolvers *, const PetscReal g[], PetscReal U[]);

#endif
