"""The shape of one muscle in neutral, from its placed template and the image (Wang 2021 §5.3 and 5.4)."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe.imaging.markers import read_landmarks, read_markers
    from handpipe.imaging.volume import pose_volume
    from handpipe.mesh.distance import Distance
    from handpipe.mesh.surface import concatenate
    from handpipe.muscles.extraction import Evidence, extract_neutral
    from handpipe.skeleton.rig import Rig
    from muscle_files import read_guesses, write_bodies

    dataset = dataset_of(snakemake)
    name = snakemake.wildcards.muscle
    guesses = read_guesses(snakemake.input.templates, dataset.muscles)
    others = [guess.surface for other, guess in guesses.items() if other != name]
    placed, known = snakemake.input.get("markers"), snakemake.input.get("landmarks")
    evidence = Evidence(
        pose_volume(dataset, dataset.neutral),
        others=others,
        bones=Distance(concatenate(list(Rig.load(snakemake.input.rig).surfaces.values()))),
        points=read_markers(placed)[0] if placed else None,
        landmarks=read_landmarks(known) if known else None,
    )
    body, extraction = extract_neutral(guesses[name], evidence)
    for figure, (value, unit) in extraction.metrics().items():
        log.info("%s: %.3f %s", figure, value, unit)
    write_bodies(snakemake.output[0], {name: body}, [*snakemake.input])
