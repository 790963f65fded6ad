// Lights that were kept by name: a button each.
PRT.ready.then(() => {
  const {page} = PRT, box = document.createElement("div"), {facts: {sets, sources}, images} = page;
  box.className = "sets";
  $("light").parentNode.before(box);
  const buttons = sets.map(({name, light, turn, strength, strengths}) => {
    const button = document.createElement("button");
    button.textContent = name;
    button.onclick = () => {
      Object.assign(page, {turn, strength, strengths: strengths.slice()});
      $("turn").value = turn;
      $("strength").value = strength;
      const sliders = $("sources").querySelectorAll("input");
      sources.filter(({kind}) => kind !== "world").forEach((source, k) => sliders[k].value = strengths[sources.indexOf(source)]);
      page.choose(light === null ? "None" : light === "world" ? "The scene's world" : [...images.keys()][light]);
      for (const each of buttons) each.setAttribute("aria-pressed", each === button);
    };
    box.append(button);
    return button;
  });
  buttons[0].click();
});
