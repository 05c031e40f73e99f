"""Run by Abaqus's own Python, of version 2.7 or 3: write fields of an .odb file at sets of nodes as a table (JSON).

``abaqus python odb_table.py JOB.odb TABLE.json U@TOP RF@TOP S@ALL``
"""
# mypy: ignore-errors

import json
import sys

COMPONENTS = {"U": ("1", "2", "3"), "RF": ("1", "2", "3"), "S": ("11", "22", "33", "12", "13", "23")}
EVERYWHERE = "ALL"


def name_of(instance):
    """Return the name of an instance; empty for nodes of the assembly itself, as reference points."""
    name = getattr(instance, "name", instance) or ""
    return "" if name == "ASSEMBLY" else name


def node_sets(odb):
    """Return the nodes of every set as pairs of instance and label, by its name in capitals."""
    sets = {}
    assembly = odb.rootAssembly
    for instance in assembly.instances.values():
        for name in instance.nodeSets.keys():
            members = members_of(instance.nodeSets[name])
            sets[(instance.name + "." + name).upper()] = members
            sets.setdefault(name.upper(), set()).update(members)
    for name in assembly.nodeSets.keys():  # which is meant, where parts have a set of its name
        sets[name.strip().upper()] = members_of(assembly.nodeSets[name])
    return sets


def members_of(node_set):
    """Return the nodes of a set, which of the assembly has an array an instance, and of an instance one."""
    members = set()
    for entry in node_set.nodes:
        for node in [entry] if hasattr(entry, "label") else entry:
            members.add((name_of(node.instanceName), int(node.label)))
    return members


def rows_of(field, kind, members):
    """Return components at the members, in their order: means over the elements at a node, or None."""
    indices = {}
    for index, member in enumerate(members or ()):
        indices[member] = index
    columns = {}
    for column, label in enumerate(field.componentLabels):
        columns[label[len(kind) :]] = column
    sums, counts = [], []
    for block in field.bulkDataBlocks:
        instance = name_of(block.instance)
        for label, values in zip(block.nodeLabels, block.data):
            member = (instance, int(label))
            if member not in indices:
                if members is not None:
                    continue
                indices[member] = len(indices)
            index = indices[member]
            while len(sums) <= index:
                sums.append([0.0] * len(COMPONENTS[kind]))
                counts.append(0)
            counts[index] += 1
            for row, component in enumerate(COMPONENTS[kind]):
                if component in columns:
                    sums[index][row] += float(values[columns[component]])
    count = len(indices)
    sums += [[0.0]] * (count - len(sums))
    counts += [0] * (count - len(counts))
    return [[value / number for value in row] if number else None for row, number in zip(sums, counts)]


def table(odb, kind, members, element_nodal):
    """Return times and rows of a field at all frames that have it; None where none has."""
    times, rows = [], []
    for step in odb.steps.values():
        for frame in step.frames:
            time = step.totalTime + frame.frameValue
            if kind not in frame.fieldOutputs.keys() or (times and time <= times[-1]):
                continue  # a step begins with the end of that before it
            field = frame.fieldOutputs[kind]
            if kind == "S":
                field = field.getSubset(position=element_nodal)
            times.append(time)
            rows.append(rows_of(field, kind, members))
    return {"times": times, "rows": rows} if times else None


def main(arguments):
    """Write the table of an .odb file."""
    from abaqusConstants import ELEMENT_NODAL
    from odbAccess import openOdb

    path, target = arguments[:2]
    odb = openOdb(path, readOnly=True)
    try:
        sets = node_sets(odb)
        fields = {}
        for request in arguments[2:]:
            kind, _, name = request.partition("@")
            if kind in COMPONENTS and (name in sets or name == EVERYWHERE):
                members = sorted(sets[name]) if name in sets else None
                fields[request] = table(odb, kind, members, ELEMENT_NODAL)
        result = {"sets": sorted(sets), "fields": fields}
    finally:
        odb.close()
    with open(target, "w") as file:
        json.dump(result, file)


if __name__ == "__main__":
    main(sys.argv[1:])
