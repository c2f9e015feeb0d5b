/*
   Many load cases of one structure on one rank, solved side by side: each is a lane, and all lanes share the links, which a
   sweep reads once for all of them, and the factor of the stiffness with all links taut.
*/
#ifndef LATINCASES_H
#define LATINCASES_H

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

/* ---- the sweeps over links (cases/sweeps.c); vectors are [nodes][dim][lanes] or [links][lanes] ---- */
typedef struct {
  PetscInt         dim, links;
  const PetscInt  *ends;                      /* [links][2] nodes */
  const PetscReal *direction, *stiffness;     /* [links][dim], [links] */
  PetscReal       *sign;                      /* [links] 1: a cable, -1: of compression only, 0: a bar */
  PetscReal       *e0;                        /* [links][lanes] */
  float           *tangent;                   /* [links][lanes] at the last displacements */
  PetscReal       *u, *w, *p, *r;             /* displacements, answer of the factor to r, direction of the search, forces without balance */
  PetscReal        all[LATIN_CASE_LANES];     /* squares of the tensions */
  PetscReal        beta[LATIN_CASE_LANES];    /* the new direction is w + beta p */
  PetscReal        work[LATIN_CASE_LANES];    /* w.K w with the tangents */
  PetscReal        tension[LATIN_CASE_LANES]; /* squares of the tensions that w makes */
  PetscReal        bend[LATIN_CASE_LANES];    /* of the new direction, as work */
} LatinCaseLinks;
PETSC_INTERN void LatinCasesForces(LatinCaseLinks *);
PETSC_INTERN void LatinCasesResistance(LatinCaseLinks *);

PETSC_INTERN PetscErrorCode LatinCasesSolve_Private(LatinStructure, const LatinCaseGoal *, PetscInt n, LatinCase[]);

#endif
