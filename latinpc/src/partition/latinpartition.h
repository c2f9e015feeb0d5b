/*
   Which subdomain each link belongs to (section 3.1): the caller's partition, or METIS.
*/
#ifndef LATINPARTITION_H
#define LATINPARTITION_H

#include "base/collective.h"
#include "base/compat.h"
#include "base/dense.h"
#include "base/fingerprint.h"
#include "base/latinbase.h"
#include "base/rankfailure.h"
#include "structure/structureimpl.h"
#include <petscblaslapack.h>

/* What is asked of a partition */
typedef struct {
  PetscInt    subdomains; /* 0: what costs least */
  PetscBool   primal;     /* all interfaces are in the coarse problem: as few subdomains as there are ranks */
  PetscBool   corners;    /* nodes of three or more subdomains have one displacement, a coarse unknown */
  PetscInt    links;      /* of this rank, for which the subdomain is given */
  PetscInt   *given;      /* [links] NULL on all ranks that have links: METIS */
  const char *choice;     /* why there are so many subdomains, said by the partition */
} LatinPartitionRequest;
PETSC_INTERN PetscErrorCode LatinPartition_Private(LatinStructure, LatinPartitionRequest *, PetscInt of_link[], PetscInt *count);

/* Links to share out, all on one rank */
typedef struct {
  PetscInt   dim, nodes, links, parts;
  PetscInt  *ends;              /* [links][2] */
  PetscReal *x;                 /* [nodes][dim] */
  PetscReal *direction;         /* [links][dim] */
  PetscBool *fixed;             /* [nodes][dim] */
  PetscBool  corners;           /* nodes of three or more subdomains have one displacement, a coarse unknown */
  PetscInt  *offset, *incident; /* [nodes + 2], [2 * links] links at each node: incident[offset[v]..offset[v + 1]) */
} LatinCut;
PETSC_INTERN PetscErrorCode LatinMetis_Private(const LatinCut *, PetscInt part[], int *failed);
PETSC_INTERN PetscInt       LatinSubdomainCount(const LatinCut *, PetscMPIInt ranks, PetscBool primal);
PETSC_INTERN PetscErrorCode LatinRepair_Private(const LatinCut *, PetscInt part[]);

#endif
