; Grasping and placing with any end-effector of human or robot.
; Source: Busch, Toussaint & Lopes (2018), section II.A, as printed; which end-effectors, objects and tables
; exist comes from the scene. `placed` is not deleted by a grasp, as printed; the planner takes it from what is moved.
(define (domain screwdriver)
  (:requirements :strips :typing :negative-preconditions)
  (:types end_effector thing table - object
          robot_hand human_hand - end_effector)
  (:predicates
    (free ?e - end_effector)
    (on_table ?o - thing)
    (grasped ?e - end_effector ?o - thing)
    (placed ?o - thing ?p - table))

  ; at time t, the end-effector e (robot or human) grasps the object o
  (:action grasp
    :parameters (?e - end_effector ?o - thing)
    :precondition (and (free ?e) (on_table ?o))
    :effect (and (grasped ?e ?o) (not (free ?e)) (not (on_table ?o))))

  ; at time t, the end-effector e (robot or human) places the object o on table p
  (:action place
    :parameters (?e - end_effector ?o - thing ?p - table)
    :precondition (grasped ?e ?o)
    :effect (and (placed ?o ?p) (not (grasped ?e ?o)) (free ?e) (on_table ?o))))
