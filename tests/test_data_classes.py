"""The dataclass decorator of the package, compared with that of the standard library."""

import copy
import dataclasses
import inspect
import pickle
from dataclasses import FrozenInstanceError, field, replace
from types import SimpleNamespace

import pytest

from viewer import data_classes


def classes(decorator):
    """Return classes of all kinds that the package uses, made by a decorator."""

    @decorator(frozen=True, slots=True)
    class Point:
        """A point."""

        x: float
        y: float = 2.0
        names: list = field(default_factory=list)
        note: str = field(default="", compare=False, repr=False)

    @decorator(slots=True, eq=False)
    class Counter:
        count: int = 0

    @decorator(slots=True, kw_only=True)
    class Options:
        size: int
        depth: int = 3

    @decorator(frozen=True, slots=True, eq=False, weakref_slot=True)
    class Checked:
        values: tuple
        total: int = field(init=False, default=0)
        largest: int = field(init=False)

        def __post_init__(self):
            object.__setattr__(self, "total", sum(self.values))
            object.__setattr__(self, "largest", max(self.values))

    @decorator(frozen=True)
    class Single:
        value: float

        def __repr__(self):
            return "single"

    @decorator
    class Empty:
        pass

    kinds = (Point, Counter, Options, Checked, Single, Empty)
    return SimpleNamespace(**{kind.__name__: kind for kind in kinds})


@data_classes.dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """A class that ``pickle`` finds by its name."""

    name: str
    values: tuple = ()


OURS, STANDARD = classes(data_classes.dataclass), classes(dataclasses.dataclass)
NAMES = sorted(vars(OURS))
ARGUMENTS = {
    "Point": ((1.0,), {"names": ["a"]}),
    "Counter": ((4,), {}),
    "Options": ((), {"size": 2}),
    "Checked": (((1, 5),), {}),
    "Single": ((0.5,), {}),
    "Empty": ((), {}),
}


def made(kinds, name):
    arguments, keywords = ARGUMENTS[name]
    return getattr(kinds, name)(*arguments, **keywords)


@pytest.mark.parametrize("name", NAMES)
def test_fields_slots_and_signature_are_those_of_the_standard_decorator(name):
    ours, standard = getattr(classes(data_classes.dataclass), name), getattr(STANDARD, name)

    # The class has no instances yet, so its ``__init__`` is not compiled.
    assert str(inspect.signature(ours)) == str(inspect.signature(standard)).removesuffix(" -> None")
    assert getattr(ours, "__slots__", None) == getattr(standard, "__slots__", None)
    assert ours.__match_args__ == standard.__match_args__
    assert (ours.__hash__ is None) == (standard.__hash__ is None)
    for mine, theirs in zip(dataclasses.fields(ours), dataclasses.fields(standard), strict=True):
        assert (mine.name, mine.type, mine.default) == (theirs.name, theirs.type, theirs.default)


@pytest.mark.parametrize("name", NAMES)
def test_instances_behave_like_those_of_the_standard_decorator(name):
    ours, standard = made(OURS, name), made(STANDARD, name)

    assert repr(ours) == repr(standard)
    assert dataclasses.asdict(ours) == dataclasses.asdict(standard)
    assert (ours == made(OURS, name)) == (standard == made(STANDARD, name))
    assert ours == ours
    assert ours != standard
    assert dataclasses.asdict(copy.deepcopy(ours)) == dataclasses.asdict(ours)


@pytest.mark.parametrize(
    ("name", "arguments", "keywords"),
    [
        ("Point", (), {}),
        ("Point", (1.0, 2.0, [], "", 5), {}),
        ("Point", (1.0,), {"x": 2.0}),
        ("Options", (1,), {}),
        ("Checked", ((1,), 2), {}),
        ("Empty", (1,), {}),
    ],
)
def test_wrong_arguments_raise_the_same_errors(name, arguments, keywords):
    with pytest.raises(TypeError) as theirs:
        getattr(STANDARD, name)(*arguments, **keywords)
    with pytest.raises(TypeError) as ours:
        getattr(OURS, name)(*arguments, **keywords)

    assert str(ours.value) == str(theirs.value)


def test_equality_and_hash_use_the_compared_fields():
    first, second = OURS.Single(0.5), OURS.Single(0.5)
    assert first == second
    assert hash(first) == hash(second) == hash((0.5,))
    assert first != OURS.Single(1.5)

    assert OURS.Point(1.0, note="a") == OURS.Point(1.0, note="b")
    with pytest.raises(TypeError, match="unhashable type: 'list'"):
        hash(OURS.Point(1.0))
    assert OURS.Counter(1) != OURS.Counter(1)


def test_frozen_fields_are_neither_assigned_nor_deleted():
    for point in (OURS.Point(1.0), replace(OURS.Point(1.0), y=3.0)):
        with pytest.raises(FrozenInstanceError, match="cannot assign to field 'x'"):
            point.x = 2.0
        with pytest.raises(FrozenInstanceError, match="cannot delete field 'x'"):
            del point.x
        assert point.x == 1.0


def test_subclasses_of_frozen_classes_can_have_further_attributes():
    class Named(OURS.Single):
        pass

    named = Named(0.5)
    named.label = "half"
    assert named.label == "half"
    del named.label
    with pytest.raises(FrozenInstanceError):
        named.value = 1.0


def test_each_instance_gets_a_new_default_from_a_factory():
    first, second = OURS.Point(1.0), OURS.Point(1.0)
    first.names.append("a")

    assert second.names == []


def test_replace_changes_some_fields():
    changed = replace(OURS.Point(1.0, names=["a"]), y=5.0)

    assert (changed.x, changed.y, changed.names) == (1.0, 5.0, ["a"])


def test_frozen_instances_with_slots_can_be_pickled():
    loaded = pickle.loads(pickle.dumps(Stored("a", (1, 2))))

    assert (loaded.name, loaded.values) == ("a", (1, 2))


def test_recursive_instances_have_a_finite_text():
    point = OURS.Point(1.0)
    point.names.append(point)

    assert repr(point).endswith("Point(x=1.0, y=2.0, names=[...])")


def test_initializer_is_compiled_once():
    kind = classes(data_classes.dataclass).Counter
    kind(1)
    compiled = kind.__init__
    kind(2)

    assert kind.__init__ is compiled


def signatures(decorator):
    """Return the signatures of classes and instances that do not use the generated initializer."""

    @decorator(frozen=True)
    class Scaled:
        factor: float

        def __init__(self, percent):
            object.__setattr__(self, "factor", percent / 100.0)

    @decorator(frozen=True, slots=True)
    class Weight:
        value: float

        def __call__(self, left, right):
            return self.value * (left + right)

    @decorator
    class Base:
        size: int

    class Derived(Base):
        def __init__(self, width, height):
            super().__init__(width * height)

    return [str(inspect.signature(each)) for each in (Scaled, Weight(1.0), Derived)]


def test_signatures_of_own_initializers_and_callable_instances_are_kept():
    expected = ["(percent)", "(left, right)", "(width, height)"]

    assert signatures(data_classes.dataclass) == signatures(dataclasses.dataclass) == expected


def test_wrapper_of_the_initializer_stays():
    kind = classes(data_classes.dataclass).Counter
    original, made = kind.__init__, []

    def counted(self, *arguments):
        made.append(arguments)
        original(self, *arguments)

    kind.__init__ = counted
    assert [kind(1).count, kind(2).count] == [1, 2]
    assert made == [(1,), (2,)]


@pytest.mark.parametrize("decorator", [data_classes.dataclass, dataclasses.dataclass])
def test_frozen_classes_with_their_own_equality_are_hashable(decorator):
    @decorator(frozen=True, slots=True)
    class Folded:
        text: str

        def __eq__(self, other):
            return isinstance(other, Folded) and self.text.lower() == other.text.lower()

    assert Folded("A") == Folded("a")
    assert hash(Folded("A")) == hash(("A",))
