# handpipe: images of one hand in several poses in, an animated, layered hand out.
from snakemake.utils import min_version

min_version("9.0")


configfile: "config/config.yaml"


container: "docker://python:3.11-slim"


include: "workflow/helpers/subjects.smk"
include: "workflow/helpers/fields.smk"
include: "workflow/helpers/poses.smk"
include: "workflow/helpers/scans.smk"
include: "workflow/helpers/templates.smk"
include: "workflow/helpers/muscles.smk"
include: "workflow/helpers/scenes.smk"
include: "workflow/helpers/ablations.smk"
include: "workflow/helpers/report.smk"
include: "workflow/helpers/benchmarks.smk"
include: "workflow/helpers/build.smk"
include: "workflow/rules/data.smk"
include: "workflow/rules/anatomy.smk"
include: "workflow/rules/truth.smk"
include: "workflow/rules/fat_water.smk"
include: "workflow/rules/segmentation.smk"
include: "workflow/rules/seeds.smk"
include: "workflow/rules/registration.smk"
include: "workflow/rules/rig.smk"
include: "workflow/rules/tendons.smk"
include: "workflow/rules/muscles.smk"
include: "workflow/rules/ligaments.smk"
include: "workflow/rules/fascia.smk"
include: "workflow/rules/fat.smk"
include: "workflow/rules/baselines.smk"
include: "workflow/rules/ablations.smk"
include: "workflow/rules/simulation.smk"
include: "workflow/rules/views.smk"
include: "workflow/rules/deviations.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/benchmarks.smk"


wildcard_constraints:
    subject="[a-z][a-z0-9-]*",
    pose="[A-Za-z][A-Za-z0-9_]*",
    bone="[A-Za-z][A-Za-z0-9_]*",
    muscle="[A-Za-z][A-Za-z0-9_]*",
    ligament="[A-Za-z][A-Za-z0-9_]*",
    tendon="[A-Za-z][A-Za-z0-9_]*",
    scene=SCENE_NAME,
    chunk="[0-9]+",
    variant="[a-z][a-z0-9_]*",


onstart:
    take_lock()


onerror:
    set_aside_failed_chunks()


localrules:
    all,
    data,
    anatomy,
    truth,
    fat_water,
    seeds,
    segmentation,
    registration,
    rig,
    tendons,
    muscles,
    ligaments,
    fasciae,
    fat,
    baselines,
    ablations,
    simulation,


# Named targets: `snakemake -j2 rig` builds that stage of every subject and what it needs.
rule all:
    default_target: True
    input:
        subject_checks(),
        separated_images(),
        each_subject(paths.REPORT),
        each_subject(paths.metrics_of("build")),
        obj_sequences(),
        views(),
        each_subject(paths.COMPLETE),


rule data:
    input:
        [path for subject in buildable_subjects() for path in scanned_files(subject)],


rule anatomy:
    input:
        expand(paths.metrics_of("anatomy"), subject=template_hands()),


rule truth:
    input:
        expand(paths.metrics_of("truth"), subject=made_by_simulation()),


rule fat_water:
    input:
        subject_checks(),
        separated_images(),


rule seeds:
    input:
        subject_checks(),
        expand(
            paths.metrics_of("seeds"),
            subject=[s for s in buildable_subjects() if proposed_poses(s)],
        ),


rule segmentation:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("segmentation")),


rule registration:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("registration")),


rule rig:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("rig")),


rule tendons:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("tendons")),


rule muscles:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("muscles")),


rule ligaments:
    input:
        subject_checks(),
        each_subject(paths.LIGAMENT),


rule fasciae:
    input:
        subject_checks(),
        each_subject(paths.BONE_FASCIA),
        each_subject(paths.MUSCLE_FASCIA),


rule fat:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("skin")),


rule baselines:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("baselines")),


rule ablations:
    input:
        subject_checks(),
        lambda w: expand(paths.metrics_of("ablations"), subject=ablated_subjects()),


rule deviations:
    input:
        subject_checks(),
        each_subject(paths.metrics_of("deviations")),


rule simulation:
    input:
        subject_checks(),
        each_subject(paths.SCENE_GLB),
        obj_sequences(),
        views(),
        each_subject(paths.SIMULATION_COMPLETE),


depend_on_code()
share_between_workflows()
