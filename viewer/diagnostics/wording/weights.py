"""Messages about the weights of a skin."""

from viewer.diagnostics.codes import Code

CODES = {
    "W001": Code(
        "warning", "weights do not sum to 1", "normalise them (--normalize shows the effect)"
    ),
    "W002": Code("warning", "negative weights", "set them to 0 and normalise"),
    "W003": Code("error", "weights that are not finite", "paint or copy these weights again"),
    "W004": Code(
        "warning", "vertices without influence", "give them the weights of their neighbours"
    ),
    "W005": Code("error", "island without any weight", "bind it to one joint as a whole"),
    "W006": Code("note", "joints without influence", "none if they are helpers"),
    "W007": Code("note", "more than 4 influences", "prune and normalise for engines that keep 4"),
    "W008": Code("note", "more than 8 influences", "prune and normalise for engines that keep 8"),
    "W009": Code("note", "joint listed twice for a vertex", "merge the two influences"),
    "W010": Code(
        "error", "weight of a joint that does not exist", "bind the joint or correct the index"
    ),
}

MESSAGES = {
    "W001.sums": "weights of {n:#vertex} do not sum to 1: {sum:.6g} at vertex {vertex}, an error "
    "of {error:.3g}",
    "W002.negative": "{n:#weight|is|are} negative: {weight:.6g} at vertex {vertex} for joint "
    "{joint:text}",
    "W004.vertices": "{n:#vertex} without influence {n:?stays where it was|stay where they were} "
    "bound, first vertex {vertex}",
    "W005.islands": "{n:#island} with {n_vertices:#vertex} {n:?has|have} no weight at all, first "
    "at vertex {vertex}: {n:?it stays where it was|they stay where they were} bound",
    "W006.joints": "{n:#joint|moves|move} no vertex: {names:list}",
    "W007.influences": "{n:#vertex|has|have} more than 4 influences, at most {most}{cost:+; {}}",
    "W008.influences": "{n:#vertex|has|have} more than 8 influences, at most {most}{cost:+; {}}",
    "W009.joints": "{n:#vertex|lists|list} a joint more than once, first vertex {vertex}",
}

PHRASES = {
    "cut-cost": "kept to {limit} the mesh moves by up to {most} (vertex {vertex}), {mean} on "
    "average of these, over {poses:#pose}{left_out:+; {}}",
    "cut-cost-unknown": "what keeping {limit} would move is not known: {left_out}",
    "cut-cost-left-out": "{n:#vertex|is|are} left out, as a position or bind matrix that "
    "{n:?it needs|they need} cannot be used",
}
