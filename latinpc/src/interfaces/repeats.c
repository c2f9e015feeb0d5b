#include "interfaces/latininterfaces.h"

/*
   Which subdomains are equal, to the bit. A structure made of repeated modules gives many of them the same operator, the
   same supports, sides, search directions and macro bases.
*/

/* What is compared: without directions and bases, where these are not made yet */
typedef struct {
  const LatinInterfaces *inter;
  const LatinDirections *dir;
  const LatinMacro      *macro;
} LatinRepeats;

/* The operator, and where the subdomain is held and touches others */
static PetscErrorCode LatinRepeatsOperator_Private(const LatinInterfaces *inter, PetscInt s, LatinStream *stream)
{
  const LatinSubdomains *sub = inter->sub;
  const PetscInt         bs = sub->bs, top = sub->node_offset[s], nodes = sub->node_offset[s + 1] - top;
  unsigned char         *room = NULL;

  PetscFunctionBegin;
  PetscCall(LatinStreamAdd_Private(stream, &nodes, sizeof(nodes)));
  PetscCall(LatinStreamRoom_Private(stream, (size_t)((bs + 1) * nodes), &room));
  for (PetscInt i = top; i < top + nodes; i++) {
    *room++ = (unsigned char)((inter->component[i] >= 0 ? 1 : 0) | (inter->share_offset[i + 1] > inter->share_offset[i] ? 2 : 0));
    for (PetscInt c = 0; c < bs; c++) *room++ = sub->fixed[bs * i + c] ? 1 : 0;
  }
  PetscCall(LatinOperatorStream_Private(sub, s, stream));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;

    PetscCall(LatinStreamAdd_Private(stream, &rows, sizeof(rows)));
    PetscCall(LatinStreamRoom_Private(stream, (size_t)rows * sizeof(rows), &room));
    for (PetscInt k = face->side_first; k < face->side_last; k++, room += sizeof(rows)) {
      const PetscInt dof = inter->side_dof[k] - bs * top;

      memcpy(room, &dof, sizeof(dof));
    }
  }
  PetscFunctionReturn(0);
}

static PetscErrorCode LatinRepeatsStream_Private(const void *ctx, PetscInt s, LatinStream *stream)
{
  const LatinInterfaces *inter = ((const LatinRepeats *)ctx)->inter;
  const LatinDirections *dir   = ((const LatinRepeats *)ctx)->dir;
  const LatinMacro      *macro = ((const LatinRepeats *)ctx)->macro;

  PetscFunctionBegin;
  if (dir && dir->like) PetscCall(LatinStreamAdd_Private(stream, &dir->like[s], sizeof(*dir->like)));
  else PetscCall(LatinRepeatsOperator_Private(inter, s, stream));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1] && dir; f++) {
    const LatinInterface *face    = &inter->interface[f];
    const PetscInt        rows    = face->side_last - face->side_first;
    const PetscInt        head[2] = {macro ? macro->of[f].modes : 0, dir->matrix_first[f]};

    PetscCall(LatinStreamAdd_Private(stream, head, sizeof(head)));
    PetscCall(LatinStreamAdd_Private(stream, dir->d + face->side_first, (size_t)rows * sizeof(PetscReal)));
    if (macro) PetscCall(LatinStreamAdd_Private(stream, macro->basis + macro->of[f].first, (size_t)(rows * macro->of[f].modes) * sizeof(PetscReal)));
  }
  PetscFunctionReturn(0);
}

/* pattern[s]: the first subdomain equal to s, in its search directions (NULL: whatever they are) and its macro bases (NULL) */
PetscErrorCode LatinRepeats_Private(const LatinInterfaces *inter, const LatinDirections *dir, const LatinMacro *macro, PetscInt pattern[])
{
  const LatinRepeats what = {inter, dir, macro};

  PetscFunctionBegin;
  PetscCall(LatinStreamCompare_Private(inter->sub->n, LatinRepeatsStream_Private, &what, pattern));
  PetscFunctionReturn(0);
}
