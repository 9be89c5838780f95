"""The JSON schema of incidents says what `Incident.read` takes."""

import json
from dataclasses import fields
from importlib.resources import files

import pytest

from DroneSwarmSearch.incident import Drone, FlownFlight, Hypothesis, Incident

jsonschema = pytest.importorskip("jsonschema")

SCHEMA = json.loads(
    files("DroneSwarmSearch.incident").joinpath("incident.schema.json").read_text("utf-8")
)
POINT = {"position": "54-10.8N 007-51.0E", "time": "2026-03-01T05:30Z", "object_class": "PIW-1"}
BASIC = {**POINT, "wind": "300 20kn", "coast": "none"}
LINE = {"line": "54-12N 007-30E; 54-04N 007-46E", "object_class": {"PIW-1": 1}}
WINDOW = ["2026-03-01T04:00Z", "2026-03-01T05:30Z"]


def is_valid(values):
    return jsonschema.Draft202012Validator(SCHEMA).is_valid(values)


def test_it_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize(
    ("kind", "shown"),
    [
        (Incident, SCHEMA),
        (Hypothesis, SCHEMA["$defs"]["hypothesis"]),
        (Drone, SCHEMA["$defs"]["drone"]),
        (FlownFlight, SCHEMA["$defs"]["flight"]["oneOf"][1]),
    ],
    ids=["incident", "hypothesis", "drone", "flight"],
)
def test_it_has_all_names_and_no_other(kind, shown):
    names = {each.name for each in fields(kind) if each.init}
    assert set(shown["properties"]) == names
    assert shown["additionalProperties"] is False


@pytest.mark.parametrize(
    "values",
    [
        BASIC,
        {**BASIC, "position": [54.18, 7.85], "position_error": "3 NM probable"},
        {**BASIC, "position": ["54-10.8N", "007-51.0E"], "time": WINDOW, "position_error": 300},
        {**BASIC, "wind": ["300 20kn", "320 30kn@08:00Z"], "current": [0.2, -0.1]},
        {
            **BASIC,
            "wind": {"0": [5, 0], "3600": [6.5, -2]},
            "object_class": {"PIW-1": 2, "PIW-2": 1},
        },
        {
            **BASIC,
            "bearing": "NNE",
            "distance": "5 NM",
            "bearing_error": 3,
            "distance_error": "1NM",
        },
        {**LINE, "time": WINDOW, "wind": "300 20kn", "coast": "none", "drones": 2},
        {
            "hypotheses": [{**POINT, "name": "call", "weight": 2}, {**LINE, "time": WINDOW}],
            "wind": "300 20kn",
            "coast": "none",
            "fleet": [{"name": "A", "aircraft": "boat"}, {"base_speed": "9kn", "base_course": 90}],
            "visibility": "5 NM",
        },
        {**BASIC, "swath": {"PIW-1": "100m"}, "probability_of_detection": {"PIW-1": 0.6}},
        {**BASIC, "area": "54-04N 007-40E; 54-06N 007-50E; 54-10N 007-45E", "position": None},
        {**BASIC, "no_fly": [[54.2, 7.8], [54.3, 7.8], [54.3, 7.9]], "night": True, "floor": "40m"},
    ],
)
def test_what_is_read_and_written_is_valid(values, tmp_path):
    values = {name: value for name, value in values.items() if value is not None}
    assert is_valid(values)
    path = tmp_path / "incident.json"
    path.write_text(json.dumps(values), "utf-8")
    if "base_speed" in str(values):
        values["fleet"][1] |= {"base": "54-10N 007-50E", "base_time": "06:30Z"}
        path.write_text(json.dumps(values), "utf-8")
    incident = Incident.read(path)
    written = json.loads(incident.as_json(tmp_path))
    jsonschema.validate(written, SCHEMA)
    path.write_text(json.dumps(written), "utf-8")
    assert Incident.read(path) == incident


@pytest.mark.parametrize(
    "values",
    [
        {**BASIC, "winds": "300 20kn"},
        {**BASIC, "position": [54]},
        {**BASIC, "drones": 0},
        {**BASIC, "drones": 1.5},
        {**BASIC, "night": "often"},
        {**BASIC, "aircraft": "boat"},
        {**BASIC, "probability_of_detection": 1.5},
        {**BASIC, "hypotheses": [{**POINT, "wind": "300 20kn"}]},
        {**BASIC, "fleet": [{"wings": 2}]},
        {**BASIC, "fleet": [{"aircraft": "balloon"}]},
        {**BASIC, "time": [*WINDOW, "2026-03-01T06:30Z"]},
    ],
)
def test_what_is_refused_is_not_valid(values, tmp_path):
    path = tmp_path / "incident.json"
    path.write_text(json.dumps(values), "utf-8")
    with pytest.raises((TypeError, ValueError)):
        Incident.read(path)
    assert not is_valid(values)
