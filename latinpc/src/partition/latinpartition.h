/*
   Which subdomain each link belongs to (section 3.1): the caller's partition, METIS on one rank, or pieces on all.
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
#include <petscmat.h>

/* The package that partitions on all ranks; undefined: PETSc has none */
#if defined(PETSC_HAVE_PTSCOTCH)
  #define LATIN_MATPARTITIONING MATPARTITIONINGPTSCOTCH
#elif defined(PETSC_HAVE_PARMETIS)
  #define LATIN_MATPARTITIONING MATPARTITIONINGPARMETIS
#endif

/* What is asked of a partition */
typedef struct {
  const char      *prefix;     /* of options */
  PetscInt         subdomains; /* 0: what costs least */
  LatinPartitioner partitioner;
  PetscBool        primal;  /* all interfaces are in the coarse problem: as few subdomains as there are ranks */
  PetscBool        corners; /* nodes of three or more subdomains have one displacement, a coarse unknown */
  PetscInt         links;   /* of this rank, for which the subdomain is given */
  PetscInt        *given;   /* [links] NULL on all ranks that have links: to be made */
  const char      *choice;  /* why there are so many subdomains, said by the partition */
} LatinPartitionRequest;
PETSC_INTERN PetscErrorCode LatinPartition_Private(LatinStructure, LatinPartitionRequest *, PetscInt of_link[], PetscInt *count);
PETSC_INTERN PetscErrorCode LatinSubdomainCount(LatinStructure, PetscBool primal, PetscInt *count);

/* Links to share out: all on one rank, or the piece of each rank with what lies around it */
typedef struct {
  MPI_Comm   comm; /* of the pieces; PETSC_COMM_SELF: all links are here */
  PetscInt   dim, nodes, links, parts;
  PetscReal  mean;              /* links a subdomain */
  PetscInt  *ends;              /* [links][2] */
  PetscReal *direction;         /* [links][dim] */
  PetscBool *fixed;             /* [nodes][dim] */
  PetscBool  corners;           /* nodes of three or more subdomains have one displacement, a coarse unknown */
  PetscInt  *offset, *incident; /* [nodes + 2], [2 * links] links at each node: incident[offset[v]..offset[v + 1]) */
  PetscSF    link_sf, node_sf;  /* the caller's links and nodes -> those here */
  /* of a piece: the nodes of the subdomains of this rank, those that links join to them, and the next ones; NULL: not one */
  PetscInt *number;  /* [nodes] the caller's, while the piece is made */
  PetscInt *of_node; /* [nodes] subdomain */
  PetscInt *depth;   /* [nodes] links away from the nodes of this rank: 0, 1, 2; all links of the nodes of 0 and 1 are here */
} LatinCut;
PETSC_INTERN PetscErrorCode LatinCutIncidence_Private(LatinCut *);
PETSC_INTERN PetscErrorCode LatinMetis_Private(const LatinCut *, PetscInt part[], int *failed);
PETSC_INTERN PetscErrorCode LatinHalves_Private(PetscInt dim, PetscInt nodes, const PetscReal x[], PetscInt links, const PetscInt ends[], PetscInt part[], int *failed);
PETSC_INTERN PetscErrorCode LatinFollow_Private(const LatinCut *, const PetscInt of_node[], PetscInt part[]);
PETSC_INTERN PetscErrorCode LatinRepair_Private(const LatinCut *, const PetscBool mine[], PetscInt give[], PetscInt take[], PetscInt part[], PetscInt *moves);
PETSC_INTERN void           LatinRepairBounds(const LatinCut *, PetscInt *least, PetscInt *most);
PETSC_INTERN PetscErrorCode LatinRepairWhole_Private(const LatinCut *, PetscInt part[]);

/* The rank that a piece is of: subdomains in blocks of like numbers */
static inline PetscMPIInt LatinPieceRank(PetscInt part, PetscInt parts, PetscMPIInt size)
{
  return (PetscMPIInt)((PetscInt64)part * size / parts);
}

/* The links at each node, in the caller's blocks of nodes */
typedef struct {
  PetscSF   ends;      /* the caller's nodes -> ends of the caller's links */
  PetscInt *offset;    /* [nodes_local + 1] */
  PetscInt *incident;  /* [offset[nodes_local]] links by the caller's numbers */
  PetscInt *neighbour; /* [offset[nodes_local]] their other nodes, in another order */
} LatinDirectory;
PETSC_INTERN PetscErrorCode LatinDirectoryCreate_Private(LatinStructure, LatinDirectory *);
PETSC_INTERN PetscErrorCode LatinDirectoryDestroy_Private(LatinDirectory *);
PETSC_INTERN PetscErrorCode LatinGraphPartition_Private(LatinStructure, LatinDirectory *, const char prefix[], PetscInt parts, PetscInt of_node[]);
PETSC_INTERN PetscErrorCode LatinPieceCreate_Private(LatinStructure, const LatinDirectory *, const PetscInt of_node[], LatinCut *);
PETSC_INTERN PetscErrorCode LatinCutDestroy_Private(LatinCut *);
PETSC_INTERN PetscErrorCode LatinConnect_Private(const LatinCut *, PetscInt local, PetscInt of_node[], PetscInt *moved);
PETSC_INTERN PetscErrorCode LatinPieces_Private(LatinStructure, const LatinPartitionRequest *, PetscInt parts, PetscInt of_link[]);

#endif
