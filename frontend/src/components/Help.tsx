import { Popover, UnstyledButton } from "@mantine/core";
import { IconHelpCircle } from "@tabler/icons-react";
import type { ReactNode } from "react";
import classes from "./Help.module.css";

interface Props {
  /** The question that the tap answers: "What is the interval?" */
  question: string;
  children: ReactNode;
}

/** An explanation on demand; a finger's width to hit, a letter's width to look at. */
export function Help({ question, children }: Props) {
  return (
    <Popover width={290} position="bottom" withArrow shadow="md" trapFocus returnFocus>
      <Popover.Target>
        <UnstyledButton className={classes["ask"]} aria-label={question} title={question}>
          <IconHelpCircle size={17} aria-hidden />
        </UnstyledButton>
      </Popover.Target>
      <Popover.Dropdown className={classes["answer"]} aria-label={question}>
        {children}
      </Popover.Dropdown>
    </Popover>
  );
}
