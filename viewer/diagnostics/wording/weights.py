"""Messages about the weights of a skin."""

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
