// What tabs of results show before there is one: drop, choose, or the example.
import { Drop, Pick } from "../parts/files";
import { Note } from "../parts/status";
import type { Result } from "./result";

export interface StartTexts {
  title: string;
  explain: string;
  drop: string;
  choose: string;
  example: string;
  reading: string;
}

export function Start<T>({ result, texts }: { result: Result<T>; texts: StartTexts }) {
  return (
    <Drop class="results-drop" label={texts.drop} onFiles={(files) => void result.take(files)}>
      <div class="nothing">
        <h1>{texts.title}</h1>
        <p class="quiet">{texts.explain}</p>
        <div class="row">
          <Pick class="main" multiple onFiles={(files) => void result.take(files)}>{texts.choose}</Pick>
          <button onClick={() => void result.example()}>{texts.example}</button>
        </div>
        <Outcome result={result} texts={texts} />
      </div>
    </Drop>
  );
}

/** Whether it is at work, and what was refused. */
export function Outcome<T>({ result, texts }: { result: Result<T>; texts: { reading: string } }) {
  return (
    <>
      {result.busy.value && <p class="quiet" role="status">{texts.reading}</p>}
      {result.problem.value && <Note tone="bad" live>{result.problem.value}</Note>}
    </>
  );
}

