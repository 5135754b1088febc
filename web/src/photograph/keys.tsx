// The list of keys.
import { Dialog } from "../parts/dialog";
import { common } from "../texts/common";
import { photographTexts as texts } from "../texts/photograph";
import { showsKeys } from "./store";

export function Keys() {
  if (!showsKeys.value) return null;
  const close = () => (showsKeys.value = false);
  return (
    <Dialog title={texts.keys.title} onClose={close}>
      <table>
        <tbody>{texts.keys.rows.map(([keys, does]) => <tr key={keys}><th scope="row"><kbd>{keys}</kbd></th><td>{does}</td></tr>)}</tbody>
      </table>
      <p class="row end"><button onClick={close}>{common.close}</button></p>
    </Dialog>
  );
}
