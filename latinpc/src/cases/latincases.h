/*
   Many load cases of one structure on one rank, solved side by side: each is a lane, and all lanes share the links, which a
   sweep reads once for all of them, and the factor of the stiffness with all links taut.
*/
#ifndef LATINCASES_H
#define LATINCASES_H

#include "base/room.h"
#include "localsolvers/latinlocalsolvers.h"

#define LATIN_CASE_LANES LATIN_FRONT_LANES /* cases side by side */

/* A case: actions beside those of the structure, NULL: none, by the numbers of the caller; and what it gives */
typedef struct {
  const PetscReal *load, *prescribed, *e0;     /* [nodes][dim], [nodes][dim], [links] */
  PetscReal       *displacement, *tension;     /* [nodes][dim], [links] */
  PetscInt         stages;                     /* that it has taken; negative: it is not solved */
  PetscReal        error, tensions, unbalance; /* estimated errors of displacements and tensions; forces without balance, relative to the loads */
} LatinCase;

/* When a case is solved */
typedef struct {
  PetscReal error, tensions, balance; /* as in LatinCase */
  PetscReal unbalance;                /* forces without balance, l2 norm */
  PetscReal far;                      /* displacements beyond which small forces are no balance */
  PetscInt  most;                     /* stages */
} LatinCaseGoal;

/*
   ---- the sweeps (cases/sweeps.c) ----
   Rows are displacement components of nodes: the free ones first, in the order in which the factor eliminates them. Links are
   in the order of their first row, so that what a sweep reads lies close together.
*/
typedef struct {
  PetscInt   dim, links, rows, free;
  PetscInt  *row;                   /* [links][2][dim] of its ends */
  PetscReal *direction, *stiffness; /* [links][dim], [links] */
  PetscReal *sign;                  /* [links] 1: a cable, -1: of compression only, 0: a bar */
  void      *room;                  /* of the arrays that follow, [rows or links][lanes] */
  PetscReal *load, *u, *r, *e0;     /* loads, displacements, forces without balance, initial elongations */
  float     *w, *p;                 /* answer of the factor to r, and direction of the search, both over scale */
  float     *tangent;               /* stiffness of each link at the last displacements */
  /* of each lane */
  _Alignas(LATIN_LINE) PetscReal scale[LATIN_CASE_LANES];                                           /* size of the forces */
  PetscReal beta[LATIN_CASE_LANES], alpha[LATIN_CASE_LANES];                                        /* the new direction is w + beta p, the step alpha times it */
  PetscReal all[LATIN_CASE_LANES];                                                                  /* squares of the tensions */
  PetscReal rr[LATIN_CASE_LANES], rp[LATIN_CASE_LANES], rw[LATIN_CASE_LANES], ww[LATIN_CASE_LANES]; /* r.r, r.p, r.w, w.w, over the square of scale, as those that follow */
  PetscReal wkw[LATIN_CASE_LANES], wkp[LATIN_CASE_LANES], pkp[LATIN_CASE_LANES];                    /* products with the tangents between */
  PetscReal tension[LATIN_CASE_LANES];                                                              /* squares of the tensions that w makes */
  PetscReal uu[LATIN_CASE_LANES];                                                                   /* squares of the free displacements, as they are */
} LatinCaseLanes;
PETSC_INTERN void LatinCasesForces(LatinCaseLanes *);
PETSC_INTERN void LatinCasesRound(LatinCaseLanes *);
PETSC_INTERN void LatinCasesResistance(LatinCaseLanes *);
PETSC_INTERN void LatinCasesMove(LatinCaseLanes *);

PETSC_INTERN PetscErrorCode LatinCasesSolve_Private(LatinStructure, const LatinCaseGoal *, PetscInt n, LatinCase[]);

#endif
