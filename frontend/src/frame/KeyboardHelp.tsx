import { ActionIcon, Title } from "@mantine/core";
import { IconKeyboard } from "@tabler/icons-react";
import { Fragment, useRef } from "react";
import { useLocation } from "wouter";
import { Note } from "../ui/Note";
import classes from "./KeyboardHelp.module.css";
import { keysOf } from "./keys";
import { useKeys } from "./useKeys";

/** Keyboard shortcuts of this page, opened by a button or `?`. Non-modal, and it does not cover the abort button. */
export function KeyboardHelp() {
  const [pathname] = useLocation();
  const dialog = useRef<HTMLDialogElement>(null);
  useKeys({
    help: () => dialog.current?.togglePopover(),
    search: () => {
      const search = document.querySelector<HTMLInputElement>("main search input");
      search?.focus();
      return search !== null;
    },
  });
  return (
    <>
      <ActionIcon
        color="gray"
        visibleFrom="xs"
        aria-label="Keyboard shortcuts"
        title="Keyboard shortcuts (?)"
        aria-haspopup="dialog"
        popoverTarget="keys"
      >
        <IconKeyboard size={22} color="var(--ink)" />
      </ActionIcon>
      <dialog
        ref={dialog}
        id="keys"
        popover="auto"
        aria-labelledby="keys-title"
        tabIndex={-1}
        className={classes["dialog"]}
        onToggle={({ newState, currentTarget }) => newState === "open" && currentTarget.focus()}
      >
        <Title order={2} id="keys-title" fz="strong" mb={12}>
          Keyboard shortcuts
        </Title>
        <dl className={classes["keys"]}>
          {keysOf(pathname).map(({ keys, does }) => (
            <Fragment key={does}>
              <dt>
                {keys.map((key) => (
                  <kbd key={key}>{key}</kbd>
                ))}
              </dt>
              <dd>{does}</dd>
            </Fragment>
          ))}
        </dl>
        <Note mt={14} fz="small">
          A real vehicle cannot take off from the keyboard: hold the button on screen for 2 s.
        </Note>
      </dialog>
    </>
  );
}
