#include "interfaces/latininterfaces.h"

/*
   Search for equal subdomains, to the bit. Three levels, each finer than the one before: the same operator and supports, as in
   structures of repeated modules; also the same sides, which differ at the rim of the structure; also the same search
   directions and macro bases.
*/

/* Data of the comparison. same: [subdomains] first subdomain with the same operator, NULL: compare operators; dir and macro, NULL: not compared */
typedef struct {
  const LatinInterfaces *inter;
  const PetscInt        *same;
  const LatinDirections *dir;
  const LatinMacro      *macro;
} LatinRepeats;

/* Appends the data of level 1 to a stream: the operator and the supports */
static PetscErrorCode LatinRepeatsOperator_Private(const void *ctx, PetscInt s, LatinStream *stream)
{
  const LatinSubdomains *sub = ((const LatinRepeats *)ctx)->inter->sub;
  const PetscInt         top = sub->node_offset[s], nodes = sub->node_offset[s + 1] - top;

  PetscFunctionBegin;
  PetscCall(LatinStreamAdd_Private(stream, &nodes, sizeof(nodes)));
  PetscCall(LatinStreamAdd_Private(stream, sub->fixed + sub->bs * top, (size_t)(sub->bs * nodes) * sizeof(*sub->fixed)));
  PetscCall(LatinOperatorStream_Private(sub, s, stream));
  PetscFunctionReturn(0);
}

/* The same of level 2: the operator, the supports and the sides */
static PetscErrorCode LatinRepeatsSides_Private(const void *ctx, PetscInt s, LatinStream *stream)
{
  const LatinRepeats    *what  = (const LatinRepeats *)ctx;
  const LatinInterfaces *inter = what->inter;
  const PetscInt         top = inter->sub->node_offset[s], nodes = inter->sub->node_offset[s + 1] - top;
  unsigned char         *room = NULL;

  PetscFunctionBegin;
  if (what->same) PetscCall(LatinStreamAdd_Private(stream, &what->same[s], sizeof(*what->same)));
  else PetscCall(LatinRepeatsOperator_Private(ctx, s, stream));
  PetscCall(LatinStreamRoom_Private(stream, (size_t)nodes, &room));
  for (PetscInt i = top; i < top + nodes; i++) *room++ = (unsigned char)((inter->component[i] >= 0 ? 1 : 0) | (inter->share_offset[i + 1] > inter->share_offset[i] ? 2 : 0));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face = &inter->interface[f];
    const PetscInt        rows = face->side_last - face->side_first;

    PetscCall(LatinStreamAdd_Private(stream, &rows, sizeof(rows)));
    PetscCall(LatinStreamRoom_Private(stream, (size_t)rows * sizeof(rows), &room));
    for (PetscInt k = face->side_first; k < face->side_last; k++, room += sizeof(rows)) {
      const PetscInt dof = inter->side_dof[k] - inter->sub->bs * top;

      memcpy(room, &dof, sizeof(dof));
    }
  }
  PetscFunctionReturn(0);
}

/* The same of level 3: all this, search directions and macro bases */
static PetscErrorCode LatinRepeatsStream_Private(const void *ctx, PetscInt s, LatinStream *stream)
{
  const LatinInterfaces *inter = ((const LatinRepeats *)ctx)->inter;
  const LatinDirections *dir   = ((const LatinRepeats *)ctx)->dir;
  const LatinMacro      *macro = ((const LatinRepeats *)ctx)->macro;

  PetscFunctionBegin;
  if (dir->like) PetscCall(LatinStreamAdd_Private(stream, &dir->like[s], sizeof(*dir->like)));
  else PetscCall(LatinRepeatsSides_Private(ctx, s, stream));
  for (PetscInt f = inter->offset[s]; f < inter->offset[s + 1]; f++) {
    const LatinInterface *face    = &inter->interface[f];
    const PetscInt        rows    = face->side_last - face->side_first;
    const PetscInt        head[2] = {macro ? macro->of[f].modes : 0, dir->matrix_first[f]};

    PetscCall(LatinStreamAdd_Private(stream, head, sizeof(head)));
    PetscCall(LatinStreamAdd_Private(stream, dir->d + face->side_first, (size_t)rows * sizeof(PetscReal)));
    if (macro) PetscCall(LatinStreamAdd_Private(stream, macro->basis + macro->of[f].first, (size_t)(rows * macro->of[f].modes) * sizeof(PetscReal)));
  }
  PetscFunctionReturn(0);
}

/* Sets same[s] to the first subdomain with the operator and the supports of s */
PetscErrorCode LatinRepeatsOperators_Private(const LatinInterfaces *inter, PetscInt same[])
{
  const LatinRepeats what = {.inter = inter};

  PetscFunctionBegin;
  PetscCall(LatinStreamCompare_Private(inter->sub->n, LatinRepeatsOperator_Private, &what, same));
  PetscFunctionReturn(0);
}

/* The same, and sets like[s] to the first one with its sides as well */
PetscErrorCode LatinRepeatsLike_Private(const LatinInterfaces *inter, PetscInt same[], PetscInt like[])
{
  const LatinRepeats what = {.inter = inter, .same = same};

  PetscFunctionBegin;
  PetscCall(LatinRepeatsOperators_Private(inter, same));
  PetscCall(LatinStreamCompare_Private(inter->sub->n, LatinRepeatsSides_Private, &what, like));
  PetscFunctionReturn(0);
}

/* Sets pattern[s] to the first subdomain equal to s, with search directions and macro bases (NULL: not compared) */
PetscErrorCode LatinRepeats_Private(const LatinInterfaces *inter, const LatinDirections *dir, const LatinMacro *macro, PetscInt pattern[])
{
  const LatinRepeats what = {.inter = inter, .dir = dir, .macro = macro};

  PetscFunctionBegin;
  PetscCall(LatinStreamCompare_Private(inter->sub->n, LatinRepeatsStream_Private, &what, pattern));
  PetscFunctionReturn(0);
}
