// A modal dialogue; Esc and its buttons close it.
import { useEffect, useId, useRef } from "preact/hooks";

export interface DialogProps {
  title: string;
  onClose: () => void;
  children: preact.ComponentChildren;
}

export function Dialog({ title, onClose, children }: DialogProps) {
  const box = useRef<HTMLDialogElement>(null);
  const id = useId();
  useEffect(() => {
    box.current?.showModal();
  }, []);
  return (
    <dialog ref={box} aria-labelledby={id} onClose={onClose} onCancel={onClose}>
      <h2 id={id}>{title}</h2>
      {children}
    </dialog>
  );
}

export interface ConfirmProps extends DialogProps {
  yes: string;
  no: string;
  onYes: () => void;
}

/** Asks before something is done. */
export function Confirm({ yes, no, onYes, children, ...rest }: ConfirmProps) {
  return (
    <Dialog {...rest}>
      <div class="column">{children}</div>
      <div class="row" style={{ justifyContent: "flex-end", marginTop: "16px" }}>
        <button onClick={rest.onClose}>{no}</button>
        <button class="main" onClick={onYes}>{yes}</button>
      </div>
    </Dialog>
  );
}
