/*
   Many load cases of one structure on one rank, solved as the lanes of vector instructions. All lanes share the links, which a sweep reads once, and the
   factor of the stiffness with all links taut.
*/
#ifndef LATINCASES_H
#define LATINCASES_H

#include "base/room.h"
#include "localsolvers/latinlocalsolvers.h"

#define LATIN_CASE_LANES LATIN_FRONT_LANES /* number of cases solved together */

/* A case: actions added to those of the structure (NULL: none), and results, in the numbering of the structure */
typedef struct {
  const PetscReal *load, *prescribed, *e0;     /* actions: [nodes][dim], [nodes][dim], [links] */
  PetscReal       *displacement, *tension;     /* results: [nodes][dim], [links] */
  PetscInt         stages;                     /* number of stages taken; negative: not solved */
  PetscReal        error, tensions, unbalance; /* estimated relative errors of displacements and tensions; residual over loads */
} LatinCase;

/* Tolerances of a case */
typedef struct {
  PetscReal error, tensions, balance; /* as in LatinCase */
  PetscReal unbalance;                /* largest l2 norm of the residual, a force */
  PetscReal far;                      /* largest displacement of a solution, a length: beyond, a small residual proves nothing */
  PetscInt  most;                     /* most stages */
} LatinCaseGoal;

/*
   ---- the sweeps (cases/sweeps.c) ----
   Rows are displacement components of nodes: free ones first, in the elimination order of the factor. Links are sorted by their first row, for locality
   of memory.
*/
typedef struct {
  PetscInt   dim, links, rows, free; /* dimension; numbers of links, of rows, of free rows */
  PetscInt  *row;                    /* [links][2][dim] rows of the ends */
  PetscReal *direction, *stiffness;  /* [links][dim], [links] */
  PetscReal *sign;                   /* [links] 1: cable, -1: compression only, 0: bar */
  void      *room;                   /* memory of the arrays that follow, [rows or links][lanes] */
  PetscReal *load, *u, *r, *e0;      /* loads, displacements, residuals, initial elongations */
  float     *w, *p;                  /* preconditioned residual K^-1 r and search direction of CG, divided by scale */
  float     *tangent;                /* tangent stiffness of each link at the last displacements */
  /* of each lane */
  _Alignas(LATIN_LINE) PetscReal scale[LATIN_CASE_LANES];                                           /* loads plus tensions at the start, a force */
  PetscReal beta[LATIN_CASE_LANES], alpha[LATIN_CASE_LANES];                                        /* CG: new direction p = w + beta p, step alpha p */
  PetscReal all[LATIN_CASE_LANES];                                                                  /* sum of squared tensions */
  PetscReal rr[LATIN_CASE_LANES], rp[LATIN_CASE_LANES], rw[LATIN_CASE_LANES], ww[LATIN_CASE_LANES]; /* r.r, r.p, r.w, w.w; over scale^2, as the next four */
  PetscReal wkw[LATIN_CASE_LANES], wkp[LATIN_CASE_LANES], pkp[LATIN_CASE_LANES];                    /* w.K w, w.K p, p.K p with the tangent stiffness K */
  PetscReal tension[LATIN_CASE_LANES];                                                              /* sum of squared tensions of w */
  PetscReal uu[LATIN_CASE_LANES];                                                                   /* sum of squared free displacements, not scaled */
} LatinCaseLanes;
PETSC_INTERN void LatinCasesForces(LatinCaseLanes *);
PETSC_INTERN void LatinCasesRound(LatinCaseLanes *);
PETSC_INTERN void LatinCasesResistance(LatinCaseLanes *);
PETSC_INTERN void LatinCasesMove(LatinCaseLanes *);

PETSC_INTERN PetscErrorCode LatinCasesSolve_Private(LatinStructure, const LatinCaseGoal *, PetscInt n, LatinCase[]);

#endif
