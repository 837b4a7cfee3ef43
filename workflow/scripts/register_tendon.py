"""A tendon's rod in one pose: simulated, then drawn to the image's dark centre and tube (Zheng 2022 §5.3)."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe import artifacts
    from handpipe.imaging.tubes import tube_surface
    from handpipe.imaging.volume import pose_volume
    from handpipe.mesh.distance import Distance
    from handpipe.mesh.surface import concatenate, each_moved
    from handpipe.skeleton.bones import read_registration
    from handpipe.skeleton.rig import Rig
    from handpipe.tendons.extraction import centre_finder
    from handpipe.tendons.registration import register
    from handpipe.tendons.rest import RestTendon
    from handpipe.tendons.surface_fit import Target

    dataset = dataset_of(snakemake)
    tendon = dataset.tendons[snakemake.wildcards.tendon]
    rig = Rig.load(snakemake.input.rig)
    neutral = artifacts.read(snakemake.input.neutral, "neutral_tendon")
    volume = pose_volume(dataset, snakemake.wildcards.pose)
    transforms = read_registration(snakemake.input.registration, tendon.bones)
    surfaces = {b: rig.surfaces[b] for b in tendon.bones}
    bones = Distance(concatenate([*each_moved(surfaces, transforms).values()]))
    radius = float(neutral["radii"].mean())
    rest = RestTendon.build(neutral["x"], neutral["radii"], surfaces)

    def target(x):
        return Target(
            Distance(tube_surface(volume, x, radius, bones)), lambda points: bones.signed(points)[0]
        )

    find_centres = centre_finder(volume, radius, bones)
    found = register(rest, {b: transforms[b] for b in tendon.bones}, find_centres, target)
    data = {"x": found.x, "twist": found.twist, "rough": found.rough, "centred": found.centred}
    units = dict.fromkeys(("x", "rough", "centred"), "mm")
    artifacts.write(snakemake.output[0], data, kind="posed_tendon", units=units, inputs=[*snakemake.input])
