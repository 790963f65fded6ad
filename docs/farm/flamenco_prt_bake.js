// A job type of Flamenco: a bake whose blocks are computed by all workers of the farm.
//
// Put this file into the folder "scripts" beside Flamenco's Manager. The workers need prt-core; the
// one that plans needs Blender's module as well (see the page on farms). The store lies where all
// workers see it. Light fields and sequences are not of this job type.

const JOB_TYPE = {
    label: "PRT Bake",
    settings: [
        { key: "blendfile", type: "string", required: true, subtype: "file_path",
          description: "The .blend file to bake", visible: "web",
          eval: "bpy.data.filepath" },
        { key: "output", type: "string", required: true, subtype: "file_path",
          description: "NAME.prt in shared storage, or s3://BUCKET/NAME.prt" },
        { key: "options", type: "string", default: "",
          description: "More of the command 'prt bake', such as --gloss --tolerance 0.02" },
        { key: "shares", type: "int32", default: 16,
          description: "Tasks that each stage is cut into" },
        { key: "stages", type: "int32", default: 5,
          description: "Stages that are computed by all; what is left is computed by one" },
        { key: "prt", type: "string", default: "prt", visible: "web",
          description: "The command, as the workers find it" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const more = settings.options ? settings.options.split(" ").filter((word) => word) : [];

    // Only a planning and a closing task write what is said of the bake, one at a time.
    let before = task("plan", settings.prt,
        ["bake", settings.blendfile, "--plan", "-o", settings.output, "--quiet", ...more]);
    job.addTask(before);
    for (let stage = 1; stage <= settings.stages; stage++) {
        const shares = [];
        for (let share = 0; share < settings.shares; share++) {
            const blocks = task(`stage ${stage}, share ${share + 1}`, settings.prt,
                ["bake-blocks", settings.output, "--quiet",
                 "--share", `${share}/${settings.shares}`]);
            blocks.addDependency(before);
            job.addTask(blocks);
            shares.push(blocks);
        }
        // Opens the next stage; the last one computes what is missing yet.
        const last = stage === settings.stages;
        const close = task(`close stage ${stage}`, settings.prt,
            ["bake", "--finish", settings.output, "--quiet", last ? "--compute" : "--open"]);
        shares.forEach((each) => close.addDependency(each));
        job.addTask(close);
        before = close;
    }
}

function task(name, exe, args) {
    const made = author.Task(name, "misc");
    made.addCommand(author.Command("exec", { exe: exe, args: args }));
    return made;
}
