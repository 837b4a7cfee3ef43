"""Volume, seeds, scan and truth of one pose of a generated subject."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.generate_pose import generate_pose

    generate_pose(dataset_of(snakemake), snakemake.wildcards.pose)
