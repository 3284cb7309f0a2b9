"""Messages about the weights of a skin."""

from viewer.diagnostics.codes import Code

CODES = {
    "W001": Code(
        "warning",
        "weights do not sum to 1",
        "normalise them ({window:?Normalise weights in the Skinning panel|--normalize} shows the "
        "effect)",
    ),
    "W002": Code("warning", "negative weights", "set them to 0 and normalise"),
    "W003": Code("error", "non-finite weights", "paint or copy these weights again"),
    "W004": Code(
        "warning", "vertices without influence", "give them the weights of their neighbours"
    ),
    "W005": Code("error", "island without weights", "bind it rigidly to one joint"),
    "W006": Code("note", "joints without influence", "none if they are helpers"),
    "W007": Code(
        "note", "more than 4 influences", "prune and normalise for engines that support only 4"
    ),
    "W008": Code(
        "note", "more than 8 influences", "prune and normalise for engines that support only 8"
    ),
    "W009": Code("note", "duplicate influences", "merge them"),
    "W010": Code(
        "error", "weight refers to a nonexistent joint", "add the joint or correct the index"
    ),
}

MESSAGES = {
    "W001.sums": "weights of {n:#vertex} do not sum to 1 (worst: {sum:.6g} at vertex {vertex}, an "
    "error of {error:.3g})",
    "W002.negative": "{n:#negative weight} (first: {weight:.6g} at vertex {vertex} for joint "
    "{joint:text})",
    "W004.vertices": "{n:#vertex|has|have} no influence and {n:?stays|stay} in the bind pose "
    "(first: vertex {vertex})",
    "W005.islands": "{n:#island} with {n_vertices:#vertex} {n:?has|have} no weights and "
    "{n:?stays|stay} in the bind pose (first: at vertex {vertex})",
    "W006.joints": "{n:#joint|has|have} no influence: {names:list}",
    "W007.influences": "{n:#vertex|has|have} more than 4 influences (maximum: {most}){cost:+; {}}",
    "W008.influences": "{n:#vertex|has|have} more than 8 influences (maximum: {most}){cost:+; {}}",
    "W009.joints": "{n:#vertex|lists|list} a joint more than once (first: vertex {vertex})",
}

PHRASES = {
    "cut-cost": "pruning to {limit} moves the mesh by up to {most} (vertex {vertex}), {mean} on "
    "average over these vertices, in {poses:#pose}{left_out:+; {}}",
    "cut-cost-unknown": "the effect of pruning to {limit} is unknown: {left_out}",
    "cut-cost-left-out": "{n:#vertex|is|are} omitted because a required position or bind matrix is "
    "invalid",
}
