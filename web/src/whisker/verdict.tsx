// What the sweeps say as a whole: the object, the record, and what the colours mean.
import type { Replay } from "../api/types";
import { Figure } from "../parts/figure";
import { Note, Status } from "../parts/status";
import { DEG, MM, fixed, plusMinus } from "../results/format";
import { Outcome } from "../results/start";
import { whiskerTexts as texts } from "../texts/whisker";
import { kindOf } from "./draw";
import { readings, result } from "./player";

export function Found({ replay }: { replay: Replay }) {
  const { found, no_object } = replay;
  if (!found) return no_object ? <section class="section"><h2>{texts.object}</h2><Note tone="grey">{no_object}</Note></section> : null;
  const { identification: id } = found;
  const word = found.is_named ? "ok" : "ambiguous";
  const coverage = id.coverage;
  const range = coverage.normals_range_rad;
  return (
    <section class="section" data-object>
      <div class="row">
        <h2>{texts.object}</h2>
        <Status word={word} text={found.is_named ? (texts.names[id.verdict] ?? id.verdict) : texts.notDecided} />
      </div>
      <Outcome result={result} texts={texts} />
      <p>{found.message}</p>
      {id.advice && <Note tone="warn">{texts.advice}: {id.advice}</Note>}
      {0 < id.parameter_order.length && (
        <table data-table="parameters">
          <thead><tr><th scope="col">{texts.parameter}</th><th scope="col" class="number">{texts.value}</th></tr></thead>
          <tbody>
            {id.parameter_order.map((name) => {
              const one = id.parameters[name];
              if (!one) return null;
              const [scale, unit] = one.unit === "rad" ? [DEG, "°"] as const : [MM, "mm"] as const;
              return (
                <tr key={name}>
                  <th scope="row">{name.replace(/_(m|rad)$/, "").replaceAll("_", " ")}</th>
                  <td class="number">{plusMinus(one.value, one.sigma, scale, unit, 3)}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      )}
      <h3>{texts.scores}</h3>
      <p class="quiet small">{texts.scoresNote}</p>
      <table data-table="scores">
        <thead><tr><th scope="col">{texts.model}</th><th scope="col" class="number">{texts.bic}</th><th scope="col" class="number">{texts.outliers}</th></tr></thead>
        <tbody>
          {id.scores.slice(0, 5).map((one) => (
            <tr key={one.model}>
              <th scope="row">{one.model.replaceAll("_", " ")}</th>
              <td class="number">{one.bic === null ? "–" : fixed(one.bic, 1)}</td>
              <td class="number">{one.n_outliers}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <p class="quiet small">
        {texts.coverage(range ? `${fixed(DEG * (range[1] - range[0]), 0)}°` : "–", coverage.used, coverage.tip_contacts, coverage.gated, coverage.corners_seen_m.length, coverage.faces_seen)}
      </p>
    </section>
  );
}

export function Record({ replay }: { replay: Replay }) {
  const help = texts.figures;
  const counts = Object.entries(replay.statuses).map(([word, n]) => `${n} ${word.replaceAll("_", " ")}`);
  return (
    <section class="section" data-record>
      <div class="row">
        <h2>{texts.record}</h2>
        {replay.is_consistent !== null && <Status word={replay.is_consistent ? "ok" : "inconsistent"} />}
      </div>
      {!replay.found && <Outcome result={result} texts={texts} />}
      {replay.is_consistent !== null && <p>{replay.is_consistent ? texts.consistent : texts.inconsistent}</p>}
      {replay.warnings.map((warning) => <Note key={warning} tone="warn">{warning}.</Note>)}
      <Figure title={help.readings} words={counts.join(", ")} help={help.readingsHelp} link="whisker.md" name="readings" />
      {replay.mu !== null && <Figure title={help.mu} words={plusMinus(replay.mu, replay.mu_sigma, 1, "")} help={help.muHelp} link="whisker.md" name="mu" />}
      {replay.median_sigma_m !== null && <Figure title={help.sigma} words={`${fixed(MM * replay.median_sigma_m, 2)} mm`} help={help.sigmaHelp} link="whisker.md" name="sigma" />}
      {1 < replay.shapes_one_in && <p class="quiet small">{texts.shapesOneIn(replay.shapes_one_in)}</p>}
      {replay.length_m === null && <p class="quiet small">{texts.noShapes}</p>}
    </section>
  );
}

export function Legend({ replay }: { replay: Replay }) {
  const kinds = new Set(readings.value.filter((one) => one.contact).map(kindOf));
  const entries = [
    ...(["mid", "tip", "weak", "odd"] as const).filter((kind) => kinds.has(kind)),
    ...(replay.length_m === null ? [] : (["hub"] as const)),
    ...(replay.found?.outline_m.length ? (["outline"] as const) : []),
    ...(replay.given_outline_m.length ? (["given"] as const) : []),
  ];
  return <span class="whisker-legend">{entries.map((entry) => <span key={entry}><span class={`swatch ${entry}`} aria-hidden="true" />{texts.legend[entry]}</span>)}</span>;
}
