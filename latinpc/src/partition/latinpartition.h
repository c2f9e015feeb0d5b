/* Partition of links into subdomains (section 3.1): given by the caller, by METIS on one rank, or in parallel by pieces. */
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
#include <petscmat.h>

/* The package that partitions on all ranks; undefined: PETSc has none */
#if defined(PETSC_HAVE_PTSCOTCH)
  #define LATIN_MATPARTITIONING MATPARTITIONINGPTSCOTCH
#elif defined(PETSC_HAVE_PARMETIS)
  #define LATIN_MATPARTITIONING MATPARTITIONINGPARMETIS
#endif

/* Parameters of a partition */
typedef struct {
  const char      *prefix;     /* prefix of options */
  PetscInt         subdomains; /* number of subdomains; 0: automatic */
  LatinPartitioner partitioner;
  PetscBool        whole;   /* whether to make one subdomain, whatever partition the structure has */
  PetscBool        primal;  /* whether all interfaces are primal: one subdomain for each rank by default */
  PetscBool        corners; /* whether nodes of three or more subdomains are primal */
  PetscInt         links;   /* length of given[] on this rank */
  PetscInt        *given;   /* [links] subdomain of each link, from the caller; NULL on all ranks with links: make a partition */
  const char      *choice;  /* reason for the number of subdomains, set by the partition */
} LatinPartitionRequest;
PETSC_INTERN PetscErrorCode LatinPartition_Private(LatinStructure, LatinPartitionRequest *, PetscInt of_link[], PetscInt *count);
PETSC_INTERN PetscErrorCode LatinSubdomainCount(LatinStructure, PetscBool primal, PetscInt *count);

/* The structure to partition: all of it on one rank, or the piece of each rank, that is, the nodes of its subdomains and two layers of halo */
typedef struct {
  MPI_Comm   comm; /* communicator of the pieces; PETSC_COMM_SELF: the whole structure is here */
  PetscInt   dim, nodes, links, parts;
  PetscReal  mean;              /* mean number of links of a subdomain */
  PetscInt  *ends;              /* [links][2] */
  PetscReal *direction;         /* [links][dim] */
  PetscBool *fixed;             /* [nodes][dim] */
  PetscBool  corners;           /* whether nodes of three or more subdomains are primal */
  PetscInt  *offset, *incident; /* [nodes + 2], [2 * links] links at each node v: incident[offset[v]..offset[v + 1]) */
  PetscSF    link_sf, node_sf;  /* links and nodes of the structure -> those here */
  /* of a piece alone; else NULL */
  PetscInt *number;  /* [nodes] global numbers, during the set-up of the piece */
  PetscInt *of_node; /* [nodes] subdomain of each node */
  PetscInt *layer;   /* [nodes] 0: node of a subdomain of this rank; 1, 2: layer of the halo. All links at layers 0 and 1 are here */
} LatinCut;
PETSC_INTERN PetscErrorCode LatinCutIncidence_Private(LatinCut *);
PETSC_INTERN PetscErrorCode LatinMetis_Private(const LatinCut *, PetscInt part[], int *failed);
PETSC_INTERN PetscErrorCode LatinHalves_Private(const LatinCut *, const PetscReal x[], PetscInt part[], int *failed);
PETSC_INTERN PetscErrorCode LatinFollow_Private(const LatinCut *, const PetscInt of_node[], PetscInt part[]);
PETSC_INTERN PetscErrorCode LatinRepair_Private(const LatinCut *, const PetscBool mine[], PetscInt give[], PetscInt take[], PetscInt part[], PetscInt *moves);
PETSC_INTERN void           LatinRepairBounds(const LatinCut *, PetscInt *least, PetscInt *most);
PETSC_INTERN PetscErrorCode LatinRepairWhole_Private(const LatinCut *, PetscInt part[]);

/* Returns the rank of a subdomain: blocks of consecutive subdomains of equal size */
static inline PetscMPIInt LatinPieceRank(PetscInt part, PetscInt parts, PetscMPIInt size)
{
  return (PetscMPIInt)((PetscInt64)part * size / parts);
}

/* The links at each node, distributed as the nodes of the structure */
typedef struct {
  PetscSF   ends;      /* nodes -> ends of the links of the structure */
  PetscInt *offset;    /* [nodes_local + 1] range of each node in incident and neighbour */
  PetscInt *incident;  /* [offset[nodes_local]] global numbers of links */
  PetscInt *neighbour; /* [offset[nodes_local]] global numbers of the other nodes of these links, in another order */
} LatinDirectory;
PETSC_INTERN PetscErrorCode LatinDirectoryCreate_Private(LatinStructure, LatinDirectory *);
PETSC_INTERN PetscErrorCode LatinDirectoryDestroy_Private(LatinDirectory *);
PETSC_INTERN PetscErrorCode LatinGraphPartition_Private(LatinStructure, LatinDirectory *, const char prefix[], PetscInt parts, PetscInt of_node[]);
PETSC_INTERN PetscErrorCode LatinPieceCreate_Private(LatinStructure, const LatinDirectory *, const PetscInt of_node[], LatinCut *);
PETSC_INTERN PetscErrorCode LatinCutDestroy_Private(LatinCut *);
PETSC_INTERN PetscErrorCode LatinConnect_Private(const LatinCut *, PetscInt local, PetscInt of_node[], PetscInt *moved);
PETSC_INTERN PetscErrorCode LatinPieces_Private(LatinStructure, const LatinPartitionRequest *, PetscInt parts, PetscInt of_link[]);

#endif
